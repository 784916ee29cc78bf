"""The character before the camera, its pictures, and its blendshapes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import UpperFace
from lipmotion.meshes.fitting.eyes_and_brows import FULL_BROW_RISE, FULL_LOOK_RAD
from lipmotion.meshes.fitting.shape_weights import CurveCosts, fit_bounded_curves, separate_opposed, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.mesh import Blendshape, Material, Mesh, MeshPart
from lipmotion_faces.characters.textures import encode_srgb
from lipmotion_faces.head.figure import Figure
from lipmotion_faces.head.pose import CharacterPose, stack_poses
from lipmotion_faces.head.skin import COLUMNS, REST, VISIBLE_RINGS
from lipmotion_faces.rendering.drawn_surface import Camera, Canvas, fill

Real = NDArray[np.float64]

_TABLE = json.loads(Path(__file__).with_name("poses.json").read_text(encoding="ascii"))
POSES = {name: CharacterPose(**pose) for name, pose in _TABLE["both"].items()}
POSES["browInnerUp"] = CharacterPose(brows=FULL_BROW_RISE)
"""The poses of the shapes that are the same on both sides."""
SIDED_POSES = {name: CharacterPose(**pose) for name, pose in _TABLE["sided"].items()}
"""The poses of the shapes that are one each for the left and the right side."""
MOOD_POSES = {"browInnerUp": CharacterPose(mood=UpperFace(inner=1))}
SIDED_MOOD_POSES = {name: CharacterPose(mood=UpperFace(**pose)) for name, pose in _TABLE["moods"].items()}
SIDED_MOOD_POSES["mouthFrown"] = CharacterPose(smile=-0.05)
"""The poses of the shapes that moods need, instead of those above and beside them; other files do not have these."""
_GAZES = {"Out": (FULL_LOOK_RAD, 0.0), "In": (-FULL_LOOK_RAD, 0.0)}
_GAZES |= {"Up": (0.0, FULL_LOOK_RAD), "Down": (0.0, -FULL_LOOK_RAD)}
MIN_DISPLACEMENT = 1e-5  # vertices that move less, in eye distances, are left out of a shape
_HALF_WIDTH = 0.12  # half the width of the strip in the middle in which both sides move


def build_head_mesh(figure: Figure, *, moods: bool = False) -> Mesh:
    """Return the character at rest, its parts named, with a blendshape for each of ``POSES`` and ``SIDED_POSES``, and
    those that turn the eyes.

    ``mouthClose`` brings the lips together while the jaw is open: it is the difference from ``jawOpen``.
    """
    rest = figure.place(REST)[0]
    left = np.clip(0.5 + rest[:, :1] / (2 * _HALF_WIDTH), 0, 1)
    sides = (("Left", left, 1.0), ("Right", 1 - left, -1.0))
    shapes: list[Blendshape] = []

    def add(name: str, start: Real, end: Real) -> None:
        shapes.append(Blendshape.between(name, start, end, smallest=MIN_DISPLACEMENT))

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


PICTURE_HEIGHT = 3.35  # height of the picture, in eye distances


@cache
def make_figure() -> Figure:
    """Return the character, made once in a process."""
    return Figure()


@cache
def make_figure_mesh(*, moods: bool = False) -> Mesh:
    """Return the character as a mesh with blendshapes, of ``build_head_mesh``, made once in a process."""
    return build_head_mesh(make_figure(), moods=moods)


def make_camera(width: int, height: int) -> Camera:
    """Return the camera for a size of pictures. Raises InputError: a size that is odd or under 64."""
    return Camera(width, height, (0.0, -0.03), PICTURE_HEIGHT)


class Stage:
    """Character, light and camera, for several threads; colour: of the background, 0 to 255 (None: a gradient)."""

    def __init__(self, camera: Camera, colour: tuple[int, int, int] | None = None) -> None:
        self.figure = make_figure()
        self.canvas = Canvas(camera, None if colour is None else fill(camera, colour))
        self._dark = Canvas(camera, fill(camera, (0, 0, 0)))
        still = self.figure.shade(CharacterPose(), camera.place)
        self._still = self.canvas.draw(*still, self.figure.triangles[self.figure.first_still_triangle :])

    def draw(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose [shape=(H, W, 3)]; only the box around head and neck is drawn anew."""
        drawn = self.figure.shade(pose, self.canvas.camera.place)
        return self.canvas.draw(*drawn, self.figure.triangles, onto=self._still, moving=self.figure.head)

    def cut_out(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose without background, with straight alpha [shape=(H, W, 4)]."""
        return self._dark.cut_out(*self.figure.shade(pose, self.canvas.camera.place), self.figure.triangles)


FROM_POSE = {"tongueOut": "tongue_out", "tongueUp": "tongue_up", "mouthPressLeft": "press", "mouthPressRight": "press"}
"""Shapes whose weight is a number of the pose."""
_NOT_OF_LIPS = ("eye", "brow", "cheek", "nose", *FROM_POSE)
PARTING = ("jawOpen", "mouthClose", "mouthLowerDown", "mouthUpperUp")
"""Shapes that are changed first so that the lips are apart as in the pose; the others where that is not enough."""
GAP_WEIGHT = 12.0  # how much the distance between the lips counts against the places of their vertices
AT_ONCE = 256
COSTS = CurveCosts(ridge=1e-3, smooth=2e-3)


def fit_mouth_weights(figure: Figure, mesh: Mesh, poses: Sequence[CharacterPose]) -> dict[str, Real]:
    """Return the weights of the shapes of lips, jaw and tongue in every pose, 0 to 1 [each shape=(T,)]."""
    return _cached_fit(figure, mesh).fit(poses)


class _MouthFit:
    """What weights of any poses are fitted with: the displacements of the shapes around the mouth."""

    def __init__(self, figure: Figure, mesh: Mesh) -> None:
        self._skin = figure.skin
        names = [name for name in mesh.shape_names if not name.startswith(_NOT_OF_LIPS)]
        moved = mesh.displacements(np.arange(len(figure.skin.rest)))
        around = np.flatnonzero(figure.skin.lip_weight > 0)[::3]
        self._around, rings = figure.skin.binding.select(around), figure.skin.list_lip_rows()
        every = _stack_rows(moved[:, rings], moved[:, around])
        rows = {name: every[mesh.shape_names.index(name)] for name in (*names, *FROM_POSE)}
        # of targets only what the shapes span counts, so they are projected at once: (T, S) numbers, not (T, vertices)
        self._spanned, self._triangle = np.linalg.qr(np.stack([rows[name] for name in names]).T)
        self._fixed = {name: rows[name] @ self._spanned for name in FROM_POSE}
        self._rest = figure.skin.place_both(REST, self._around)
        parting = measure_lip_gap(moved[:, rings])[[mesh.shape_names.index(name) for name in names]]
        self._shapes = FaceShapes(tuple(names), tuple(names), np.zeros((len(names), 0, 3)), parting, "arkit")

    def fit(self, poses: Sequence[CharacterPose]) -> dict[str, Real]:
        """Return the weights of ``fit_mouth_weights``."""
        names = self._shapes.names
        fixed = {name: np.array([getattr(pose, field) for pose in poses], float) for name, field in FROM_POSE.items()}
        parts = []
        for first in range(0, len(poses), AT_ONCE):
            both = self._skin.place_both(stack_poses(poses[first : first + AT_ONCE]), self._around)
            lips, around = (places - rest for places, rest in zip(both, self._rest, strict=True))
            parts.append((_stack_rows(lips, around) @ self._spanned, measure_lip_gap(lips)))
        targets, gap = (np.concatenate(column) for column in zip(*parts, strict=True))
        for name, curve in fixed.items():
            targets -= np.outer(curve, self._fixed[name])
        weights = fit_bounded_curves(self._triangle.T, targets, COSTS)
        weights = separate_opposed(weights, self._triangle.T, names, COSTS, (0.0, 1.0))
        jaw, close = names.index("jawOpen"), names.index("mouthClose")
        weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])
        others = [name for name in names if not name.startswith(PARTING)]
        weights = with_gap(with_gap(weights, self._shapes, gap, others), self._shapes, gap)
        return dict(zip(names, weights.T, strict=True)) | fixed


_cached_fit = lru_cache(maxsize=2)(_MouthFit)


def measure_lip_gap(moved: Real) -> Real:
    """Return by how much displacements [shape=(..., RINGS, COLUMNS, 3)] part the lips' middle [shape=(...,)]."""
    upper, lower = _list_edges(moved)
    middle = upper.shape[-1] // 2
    return np.asarray(upper[..., middle] - lower[..., middle])


def _list_edges(moved: Real) -> tuple[Real, Real]:
    """Return the upward displacements of the edges of the upper and the lower lip that meet [shape=(..., N), both]."""
    edge, half = moved[..., VISIBLE_RINGS - 1, :, 1], COLUMNS // 2
    return edge[..., 1:half], edge[..., :half:-1]


def _stack_rows(lips: Real, around: Real) -> Real:
    """Return displacements of lips and of the skin around them as rows of a least squares problem, with gaps."""
    upper, lower = _list_edges(lips)
    shape = (*lips.shape[:-3], -1)
    visible = lips[..., :VISIBLE_RINGS, :, :].reshape(shape)
    return np.concatenate([visible, 0.5 * around.reshape(shape), GAP_WEIGHT * (upper - lower)], axis=-1)
