"""The character before the camera: pictures of poses."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import UpperFace
from lipmotion.meshes.fitting.eyes_and_brows import FULL_BROW_RISE, FULL_LOOK_RAD
from lipmotion.meshes.model.mesh import Blendshape, Material, Mesh, MeshPart
from lipmotion.meshes.model.textures import encode_srgb
from lipmotion_faces.head.figure import Figure
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import REST
from lipmotion_faces.rendering.rasteriser import Camera, Canvas, flat

Real = NDArray[np.float64]

POSES = {
    "jawOpen": CharacterPose(gap=0.3, upper_rise=0.03, jaw=0.23),
    "mouthClose": CharacterPose(jaw=0.23),
    "mouthFunnel": CharacterPose(gap=0.1, upper_rise=0.042, jaw=0.05, width=0.8, roundness=1, protrusion=0.09),
    "mouthPucker": CharacterPose(gap=0.02, upper_rise=0.01, width=0.7, roundness=1, protrusion=0.1, fullness=1.1),
    "mouthRollLower": CharacterPose(gap=0.054, upper_rise=0.054, tuck=1),
    "tongueOut": CharacterPose(tongue_out=1),
    "tongueUp": CharacterPose(tongue_up=1),
    "browInnerUp": CharacterPose(brows=FULL_BROW_RISE),
}
"""The poses of the shapes that are the same on both sides."""
SIDED_POSES = {
    "mouthSmile": CharacterPose(smile=0.05, width=1.05),
    "mouthStretch": CharacterPose(width=1.25, spread=1),
    "mouthUpperUp": CharacterPose(gap=0.05, upper_rise=0.05),
    "mouthLowerDown": CharacterPose(gap=0.08),
    "mouthPress": CharacterPose(press=1),
    "eyeBlink": CharacterPose(shut=1),
}
"""The poses of the shapes that are one each for the left and the right side."""
MOOD_POSES = {"browInnerUp": CharacterPose(mood=UpperFace(inner=1))}
SIDED_MOOD_POSES = {
    "browDown": CharacterPose(mood=UpperFace(lowered=1)),
    "browOuterUp": CharacterPose(mood=UpperFace(outer=1)),
    "eyeSquint": CharacterPose(mood=UpperFace(squint=1)),
    "eyeWide": CharacterPose(mood=UpperFace(wide=1)),
    "cheekSquint": CharacterPose(mood=UpperFace(cheek=1)),
    "noseSneer": CharacterPose(mood=UpperFace(sneer=1)),
    "mouthFrown": CharacterPose(smile=-0.05),
}
"""The poses of the shapes that moods need, instead of those above and beside them; other files do not have these."""
_GAZES = {"Out": (FULL_LOOK_RAD, 0.0), "In": (-FULL_LOOK_RAD, 0.0)}
_GAZES |= {"Up": (0.0, FULL_LOOK_RAD), "Down": (0.0, -FULL_LOOK_RAD)}
LEAST_DISPLACEMENT = 1e-5
"""Vertices that move less, in eye distances, are left out of a shape."""
_HALF_WIDTH = 0.12
"""Half the width of the strip in the middle in which both sides move."""


def head_mesh(figure: Figure, *, moods: bool = False) -> Mesh:
    """Return the character at rest, its parts named, with a blendshape for each of ``POSES`` and ``SIDED_POSES``, and
    those that turn the eyes.

    ``mouthClose`` brings the lips together while the jaw is open: it is the difference from ``jawOpen``.
    """
    rest = figure.place(REST)[0]
    left = np.clip(0.5 + rest[:, :1] / (2 * _HALF_WIDTH), 0, 1)
    sides = (("Left", left, 1.0), ("Right", 1 - left, -1.0))
    shapes: list[Blendshape] = []

    def add(name: str, start: Real, end: Real) -> None:
        shapes.append(Blendshape.between(name, start, end, smallest=LEAST_DISPLACEMENT))

    for name, pose in (POSES | MOOD_POSES if moods else POSES).items():
        start = figure.place(POSES["jawOpen"])[0] if name == "mouthClose" else rest
        add(name, start, figure.place(pose)[0])
    for name, pose in (SIDED_POSES | SIDED_MOOD_POSES if moods else SIDED_POSES).items():
        moved = figure.place(pose)[0] - rest
        for side, share, _ in sides:
            add(name + side, rest, rest + share * moved)
    for name, (across, upwards) in _GAZES.items():
        for side, share, outward in sides:
            moved = figure.place(CharacterPose(gaze=(outward * across, upwards)))[0] - rest
            add(f"eyeLook{name}{side}", rest, rest + share * moved)
    pieces = [(name, count, figure.parts[0]) for name, count in figure.skin.pieces.items()]
    pieces += [(each.name, len(each.triangles), each) for each in figure.parts[1:]]
    parts, first = [], 0
    for name, count, each in pieces:
        seen = np.unique(figure.triangles[first : first + count])
        red, green, blue = encode_srgb(np.clip(figure.colours[seen].mean(axis=0), 0, 1)).tolist()
        material = Material(name, (red, green, blue), min(2 * each.finish.gloss, 1.0))
        parts.append(MeshPart(name, first, first + count, material))
        first += count
    return Mesh(rest, figure.triangles, tuple(parts), tuple(shapes), colours=encode_srgb(np.clip(figure.colours, 0, 1)))


PICTURE_HEIGHT = 3.35
"""Height of the picture, in eye distances."""


@cache
def figure() -> Figure:
    """Return the character, made once in a process."""
    return Figure()


@cache
def mesh_of_figure(*, moods: bool = False) -> Mesh:
    """Return the character as a mesh with blendshapes, of ``head_mesh``, made once in a process."""
    return head_mesh(figure(), moods=moods)


def camera_for(width: int, height: int) -> Camera:
    """Return the camera for a size of pictures. Raises InputError: a size that is odd or under 64."""
    return Camera(width, height, (0.0, -0.03), PICTURE_HEIGHT)


class Stage:
    """Character, light and camera, for several threads; colour: of the background, 0 to 255 (None: a gradient)."""

    def __init__(self, camera: Camera, colour: tuple[int, int, int] | None = None) -> None:
        self.figure = figure()
        self.canvas = Canvas(camera, None if colour is None else flat(camera, colour))
        self._dark = Canvas(camera, flat(camera, (0, 0, 0)))
        still = self.figure.frame(CharacterPose(), camera.place)
        first = self.figure.first_still_triangle
        self._still = self.canvas.picture(still.places, still.light, self.figure.triangles[first:])

    def picture(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose [shape=(H, W, 3)]; only the box around head and neck is drawn anew."""
        drawn = self.figure.frame(pose, self.canvas.camera.place)
        return self.canvas.picture(
            drawn.places, drawn.light, self.figure.triangles, onto=self._still, moving=self.figure.head
        )

    def cut_out(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose without background, with straight alpha [shape=(H, W, 4)]."""
        drawn = self.figure.frame(pose, self.canvas.camera.place)
        return self._dark.cut_out(drawn.places, drawn.light, self.figure.triangles)
