"""The user's own character as a face: its mesh, moved by its blendshapes or control points, drawn by the rasteriser."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import eye_and_brow_weights
from lipmotion.meshes.model.mesh import HEAD, LEFT_EYE, NECK, RIGHT_EYE
from lipmotion.storage.files import atomic_file
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion.types.motion import compute_frame_times
from lipmotion_faces import base
from lipmotion_faces.characters.binding import DrivenPose, PosedCharacter
from lipmotion_faces.characters.surface import build_surface, compute_normals, drop_back_sides
from lipmotion_faces.rendering.drawn_surface import Camera, TexturedCanvas, fill, prepare_surface

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Turn = Sequence[float]

SHARE_BELOW_MOUTH = 0.55
"""The picture shows as much below the mouth as this share of what is above it, up to the top of the head."""
PICTURE_SHARE = 0.92  # the picture is cut to this share of that height: hair may leave it at the top
DISTANCE = 2.8  # the camera is this many heights of the picture away
DRAWN_HEIGHTS = 1.7
"""Everything within this many heights of the picture around the mouth is drawn: of a body, head and shoulders."""
PIVOT = np.array([0.0, 0.12, -1.05])
"""The head turns about this place where no bone says another one: the top of the neck, in eye distances from the middle
between the corners of the mouth."""
NECK_TOP, NECK_BOTTOM = -0.55, -1.6
"""Where no bone says it: above this height all follows the head, below the second nothing, in eye distances."""
NECK_SHARE = 0.4  # what follows the neck but not the head goes this part of the way
STILL: Turn = (0.0, 0.0, 0.0)
WIDTH, HEIGHT = 1280, 720
FRAMES_AHEAD = 2


class MeshPose(NamedTuple):
    """A character in one frame: of ``PosedCharacter.poses``, angles of the head, and of the eyes, in radians."""

    row: DrivenPose
    turn: Turn
    look: Sequence[float]


@final
class MeshFace(base.Face):
    """A character from a file, head and shoulders from the front.

    character     : from ``load_character``
    width, height : of the pictures in pixels, even; a size of the staging counts instead, 16 to 9
    staging       : background, seed, and what moves on its own; None: the defaults
    """

    def __init__(
        self,
        character: PosedCharacter,
        width: int = WIDTH,
        height: int = HEIGHT,
        staging: base.Staging | None = None,
        prosody: Prosody | None = None,
    ) -> None:
        self.staging = staging or base.Staging()
        self.character, self._prosody, self._size = character, prosody, (width, height)

    def with_staging(self, staging: base.Staging, prosody: Prosody | None = None) -> MeshFace:
        """Return the same character with other settings, and prosody for accents of brows and head."""
        return MeshFace(self.character, *self._size, staging, prosody)

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.draw(motion, units, fps=fps))

    def draw(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> base.DrawnMotion[MeshPose]:  # noqa: D102
        time_s = compute_frame_times(len(motion.values), motion.rate_hz, fps)
        motions = base.stage_liveliness(time_s, with_mouth(motion), units, self.staging, self._prosody)
        rows = self.character.poses(motion, units, time_s, eye_and_brow_weights(motions))
        gaze = motions.gaze if not self.character.has_shape("eyeLookOutLeft") else np.zeros_like(motions.gaze)
        poses = [MeshPose(*pose) for pose in zip(rows, motions.turn.tolist(), gaze.tolist(), strict=True)]
        return base.DrawnMotion(poses, lambda: self._painter, FRAMES_AHEAD)

    @cached_property
    def _painter(self) -> Callable[[MeshPose], base.Picture]:
        width, height = self._size
        if self.staging.size:
            width, height = max(2 * round(self.staging.size * 8 / 9), base.SMALLEST_PX), self.staging.size
        stage = MeshStage(self.character, width, height, self.staging.colour)
        draw = stage.cut_out if self.staging.background == base.TRANSPARENT else stage.draw
        return lambda pose: draw(self.character.place_vertices(pose.row), pose.turn, pose.look)


def write_picture(path: Path, character: PosedCharacter) -> None:
    """Write a picture of a character at rest as PNG. Raises ExportError: it cannot be written."""
    from PIL import Image

    picture = MeshStage(character, WIDTH, HEIGHT).draw(character.mesh.vertices)
    with atomic_file(path) as unfinished:
        Image.fromarray(picture).save(unfinished, format="PNG")


class MeshStage:
    """A mesh before the camera, in light, for several threads; colour: of the background (None: a gradient)."""

    def __init__(
        self, character: PosedCharacter, width: int, height: int, colour: tuple[int, int, int] | None = None
    ) -> None:
        mesh, placement = drop_back_sides(character.mesh), character.placement
        surface = build_surface(mesh)
        corners = placement.vertices[[placement.row(RIGHT_CORNER), placement.row(LEFT_CORNER)]]
        self._centre = mesh.vertices[corners].mean(axis=0)
        self._turn = placement.axes / placement.scale
        self._rest = self._place(mesh.vertices)
        face = surface.pieces == surface.pieces[placement.vertices[0]]
        top = float(self._rest[face, 1].max())
        across = PICTURE_SHARE * (1 + SHARE_BELOW_MOUTH) * top
        camera = Camera(width, height, (0.0, (1 - SHARE_BELOW_MOUTH) / 2 * top), across, DISTANCE * across)
        near = np.linalg.norm(self._rest, axis=1) < DRAWN_HEIGHTS * across
        shown = np.asarray(near[mesh.triangles].any(axis=1))
        self._drawn = prepare_surface(mesh, shown, height / across / placement.scale)
        self._canvas = TexturedCanvas(camera, self._drawn.triangles, None if colour is None else fill(camera, colour))
        self._joined, self._moving = surface.places, character.moving
        # what must be lit again when the moving vertices move: the places (of vertices that files split) around them,
        # their triangles, and for each vertex whose normal changes its place among these, and the vertex
        triangles = self._joined[mesh.triangles]
        moving, around = np.zeros((2, int(self._joined.max(initial=-1)) + 1), bool)
        moving[self._joined[self._moving]] = True
        around[triangles[moving[triangles].any(axis=1)]] = True
        bent = triangles[around[triangles].any(axis=1)]
        self._bent, numbers = np.unique(bent, return_inverse=True)
        self._bent_triangles = numbers.reshape(bent.shape).astype(np.int32)
        rows = np.flatnonzero(around[self._joined])
        self._inside = np.searchsorted(self._bent, self._joined[rows]), rows
        self._normals = compute_normals(self._join(self._rest), triangles.astype(np.int32))[self._joined]
        self._share, self._pivot = self._weigh_head(character, face)
        self._eyes: list[tuple[Rows, Array, Array]] = []
        for bone in mesh.bones:
            if bone.kind in (LEFT_EYE, RIGHT_EYE):
                held = self._rest[bone.rows[bone.shares > 0.5 * bone.shares.max()]]
                middle = (held.min(axis=0) + held.max(axis=0)) / 2
                self._eyes.append((bone.rows, bone.shares[:, None], middle))
        self._light, self._shine = self._light_vertices(self._rest, self._normals, np.arange(len(self._drawn.rows)))
        self._still = self._canvas.draw(self._rest[self._drawn.rows], self._light, self._shine)

    def draw(self, vertices: Array, turn: Turn = STILL, gaze: Sequence[float] = (0.0, 0.0)) -> base.Picture:
        """Return the picture of the mesh with its vertices at other places [shape=(H, W, 3)].

        vertices : in the frame and unit of the mesh [shape=(V, 3)]
        turn     : of the head to the character's left, upwards and to the left shoulder, in radians
        gaze     : of the eyes to the character's left and upwards, in radians, where bones turn them
        Only the box around what moves is drawn anew.
        """
        places, light, shine, moved = self._pose(vertices, turn, gaze)
        if not moved.any():
            return self._still.copy()
        drawn = moved[self._drawn.rows]
        area = np.concatenate([places[drawn], self._rest[self._drawn.rows[drawn]]])
        return self._canvas.draw(places, light, shine, onto=self._still, moving=area)

    def cut_out(self, vertices: Array, turn: Turn = STILL, gaze: Sequence[float] = (0.0, 0.0)) -> base.Picture:
        """Return the same picture without background, with straight alpha [shape=(H, W, 4)]."""
        places, light, shine, _ = self._pose(vertices, turn, gaze)
        return self._canvas.cut_out(places, light, shine)

    def _pose(
        self, vertices: Array, turn: Turn, gaze: Sequence[float]
    ) -> tuple[Array, NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Return places, light and highlights of the drawn vertices, and which vertices of the mesh have moved."""
        places, normals = self._place(vertices), self._normals.copy()
        moved = np.zeros(len(places), bool)
        if len(self._moving):
            inside, rows = self._inside
            normals[rows] = compute_normals(self._join(places)[self._bent], self._bent_triangles)[inside]
            moved[rows] = True
        if any(gaze):
            look = base.rotate_head(*gaze).T
            for rows, share, centre in self._eyes:
                places[rows] += share * ((places[rows] - centre) @ look + centre - places[rows])
                normals[rows] += share * (normals[rows] @ look - normals[rows])
                moved[rows] = True
        if any(turn):
            rotation, share = base.rotate_head(*turn).T, self._share[:, None]
            places += share * ((places - self._pivot) @ rotation + self._pivot - places)
            normals += share * (normals @ rotation - normals)
            moved |= self._share > 0
        changed = np.flatnonzero(moved[self._drawn.rows])
        light, shine = self._light.copy(), self._shine.copy()
        light[changed], shine[changed] = self._light_vertices(places, normals, changed)
        return places[self._drawn.rows], light, shine, moved

    def _weigh_head(self, character: PosedCharacter, face: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return how far each vertex follows the head, 0 to 1 [shape=(V,)], and where the head turns [shape=(3,)]."""
        bones = {bone.kind: bone for bone in character.mesh.bones}
        lips = character.placement.vertices
        if HEAD in bones and np.isin(lips, bones[HEAD].rows).all():
            share = np.zeros(len(self._rest))
            if NECK in bones:
                share[bones[NECK].rows] = NECK_SHARE * bones[NECK].shares
            head = bones[HEAD]
            share[head.rows] += (1 - NECK_SHARE if NECK in bones else 1.0) * head.shares
            pivot = self._place(head.place[None])[0]
            usual = np.abs(pivot[0]) < 0.5 and -1.0 < pivot[1] < 1.0 and -2.5 < pivot[2] < 0.2
            return np.clip(share, 0, 1), pivot if usual and not np.ptp(share) < 1e-9 else PIVOT
        if self._rest[face, 1].min() > 2 * NECK_TOP:  # a head without a neck
            return np.ones(len(self._rest)), PIVOT
        return smooth_step((self._rest[:, 1] - NECK_BOTTOM) / (NECK_TOP - NECK_BOTTOM)), PIVOT

    def _join(self, vertices: Array) -> Array:
        """Return one vertex of each place [shape=(P, 3)]."""
        result = np.zeros((int(self._joined.max(initial=-1)) + 1, 3))
        result[self._joined] = vertices
        return result

    def _place(self, vertices: Array) -> Array:
        """Return vertices in eye distances from the mouth, upright and towards the camera."""
        return (vertices - self._centre) @ self._turn

    def _light_vertices(
        self, places: Array, normals: Array, chosen: Rows
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return light and highlights of some drawn vertices, from places and normals of the mesh's vertices."""
        rows, kinds = self._drawn.rows[chosen], self._drawn.kinds[chosen]
        facing, colours = normals[rows] * self._drawn.sides[chosen, None], self._drawn.colours[chosen]
        at, viewer, lighting = places[rows], self._canvas.camera.place, self._drawn.lighting
        light = lighting.shade(at, facing, colours, kinds, viewer)
        shine = lighting.shade(at, facing, np.zeros_like(colours), kinds, viewer)
        return light - shine, shine
