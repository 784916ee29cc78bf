"""The user's own character as a face: its mesh, moved by its blendshapes or control points, drawn by the rasteriser."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.faces.base import Face
from lipmotion.rig.driven import DrivenCharacter
from lipmotion.rig.lighting import Finish, Lighting, linear
from lipmotion.rig.mesh import Mesh
from lipmotion.rig.mouth_template import LEFT_CORNER, RIGHT_CORNER
from lipmotion.rig.rasteriser import Camera, Canvas, normals_of
from lipmotion.rig.surface import mesh_surface
from lipmotion.types import Motion, Timeline, Unit

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

WIDTH, HEIGHT = 1280, 720
BELOW = 0.55
"""The picture shows as much below the mouth as this share of what is above it, up to the top of the head."""
TIGHT = 0.92
"""And of all that this share: hair may leave the picture at the top."""
DISTANCE = 2.8
"""The camera is this many heights of the picture away."""
HEAD = 1.1
"""Everything within this many heights of the picture around the mouth is drawn: of a body, head and shoulders."""
BLINK_S, BLINKS_S = 0.16, (2.0, 5.0)
"""How long a blink takes, and the range of times between two of them, in seconds."""
SEED = 5
THREADS = 2
"""Pictures that are drawn at the same time."""
LEAST_OPACITY = 0.5
"""Parts that are clearer than this are not drawn: shells around eyes, what a texture leaves out."""
SCATTER = (0.3, 0.2, 0.15)
"""How far red, green and blue light reach round into the shade, as in skin."""


@final
class MeshFace(Face):
    """A character from a file, head and shoulders from the front.

    character     : from ``driven_character``
    width, height : of the pictures in pixels, even
    seed          : of the blinks, where the character has blendshapes for them
    """

    def __init__(self, character: DrivenCharacter, width: int = WIDTH, height: int = HEIGHT, seed: int = SEED) -> None:
        self._character, self._seed = character, seed
        self._stage = MeshStage(character, width, height)

    @property
    def character(self) -> DrivenCharacter:
        """The character that is shown."""
        return self._character

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        if not 0 < fps < np.inf:
            raise InputError(f"the frame rate is {fps}, required more than 0")
        count = int(np.floor((len(motion.values) - 1) / motion.rate_hz * fps + 1e-9)) + 1
        time_s = np.arange(count) / fps
        frames = self._character.vertices(motion, units, time_s, blink_curve(time_s, self._seed))
        with ThreadPoolExecutor(THREADS) as threads:
            waiting: deque[Future[NDArray[np.uint8]]] = deque()
            for vertices in frames:
                waiting.append(threads.submit(self._stage.picture, vertices))
                if len(waiting) > THREADS:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()


class MeshStage:
    """A mesh before the camera, in light; may be used by several threads at once."""

    def __init__(self, character: DrivenCharacter, width: int, height: int) -> None:
        mesh, placement, surface = character.mesh, character.placement, mesh_surface(character.mesh)
        corners = placement.vertices[[placement.row(RIGHT_CORNER), placement.row(LEFT_CORNER)]]
        self._centre = mesh.vertices[corners].mean(axis=0)
        self._turn = placement.axes / placement.scale
        self._rest = self._placed(mesh.vertices)
        top = float(self._rest[surface.pieces == surface.pieces[placement.vertices[0]], 1].max())
        across = TIGHT * (1 + BELOW) * top
        camera = Camera(width, height, (0.0, (1 - BELOW) / 2 * top), across, DISTANCE * across)
        self._viewer = camera.place
        self._canvas = Canvas(camera)
        self._drawn = _drawn_triangles(mesh, np.linalg.norm(self._rest, axis=1) < HEAD * across)
        self._joined = surface.places
        self._moving = character.moving
        self._bent, self._bent_triangles, inside = self._affected(mesh)
        self._inside, self._affected_rows = inside
        self._kinds, self._colours, self._lighting = _look(mesh)
        normals = normals_of(self._of_places(self._rest), self._joined[mesh.triangles].astype(np.int32))[self._joined]
        self._light = self._lit(self._rest, normals, np.arange(len(self._rest)))
        self._still = self._canvas.picture(self._rest, self._light, self._drawn)

    def picture(self, vertices: Array) -> NDArray[np.uint8]:
        """Return the picture of the mesh with its vertices at other places [shape=(H, W, 3)]."""
        if not len(self._moving):
            return self._still.copy()
        places = self._placed(vertices)
        bent = normals_of(self._of_places(places)[self._bent], self._bent_triangles)
        light = self._light.copy()
        light[self._affected_rows] = self._lit(places, bent[self._inside], self._affected_rows, given=True)
        area = np.concatenate([places[self._moving], self._rest[self._moving]])
        return self._canvas.picture(places, light, self._drawn, onto=self._still, moving=area)

    def _affected(self, mesh: Mesh) -> tuple[Rows, NDArray[np.int32], tuple[Rows, Rows]]:
        """Return what must be lit again when the moving vertices move.

        First the places (of vertices that files split) around them, and their triangles; then, for each vertex whose
        normal changes, its place among these, and the vertex.
        """
        triangles = self._joined[mesh.triangles]
        count = int(self._joined.max(initial=-1)) + 1
        moving, near = np.zeros(count, bool), np.zeros(count, bool)
        moving[self._joined[self._moving]] = True
        near[triangles[moving[triangles].any(axis=1)]] = True
        around = triangles[near[triangles].any(axis=1)]
        places, corners = np.unique(around, return_inverse=True)
        rows = np.flatnonzero(near[self._joined])
        inside = np.searchsorted(places, self._joined[rows])
        return places, corners.reshape(around.shape).astype(np.int32), (inside, rows)

    def _of_places(self, vertices: Array) -> Array:
        """Return one vertex of each place [shape=(P, 3)]."""
        result = np.zeros((int(self._joined.max(initial=-1)) + 1, 3))
        result[self._joined] = vertices
        return result

    def _placed(self, vertices: Array) -> Array:
        """Return vertices in eye distances from the mouth, upright and towards the camera."""
        return (vertices - self._centre) @ self._turn

    def _lit(self, places: Array, normals: Array, rows: Rows, *, given: bool = False) -> NDArray[np.float32]:
        """Return the light of some vertices; ``given``: the normals are those of the rows alone."""
        chosen = normals if given else normals[rows]
        return self._lighting.light(places[rows], chosen, self._colours[rows], self._kinds[rows], self._viewer)


def blink_curve(time_s: Array, seed: int = SEED) -> Array:
    """Return how far the eyes are shut, 0 to 1, at some times in seconds [shape=(T,)]: a blink every few seconds."""
    draw = np.random.default_rng(seed)
    shut = np.zeros(len(time_s))
    at_s = draw.uniform(*BLINKS_S)
    while len(time_s) and at_s < time_s[-1]:
        shut = np.maximum(shut, np.clip(1.6 * (1 - np.abs(time_s - at_s) / (BLINK_S / 2)), 0, 1))
        at_s += draw.uniform(*BLINKS_S)
    return shut


def _drawn_triangles(mesh: Mesh, near: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the triangles near the mouth, without those that are clear as glass [shape=(F', 3)]."""
    shown = np.asarray(near[mesh.triangles].any(axis=1))
    for part in mesh.parts:
        if part.material.opacity < LEAST_OPACITY:
            shown[part.first : part.stop] = False
    return mesh.triangles[shown]


def _look(mesh: Mesh) -> tuple[Rows, Array, Lighting]:
    """Return the finish and the colour of every vertex, and the lighting for these finishes."""
    kinds = np.zeros(len(mesh.vertices), np.int64)
    colours = np.full((len(mesh.vertices), 3), 0.5)
    for number, part in enumerate(mesh.parts):
        rows = np.unique(mesh.triangles[part.first : part.stop])
        kinds[rows], colours[rows] = number, linear(part.material.colour)
    if mesh.colours is not None:
        colours = linear(mesh.colours)
    finishes = [
        Finish(SCATTER, gloss=0.5 * part.material.gloss, focus=4 + round(2 * part.material.gloss))
        for part in mesh.parts
    ]
    return kinds, colours, Lighting(finishes)
