"""What a file for 3D programs holds: a mesh, its curves, the turning of its head, and the sound that belongs to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError, InputError
from lipmotion.formats.base import Thinning
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.types import Motion
from lipmotion_faces.characters.surface import build_surface, compute_normals, drop_back_sides

Array = NDArray[np.float64]

EVERY_KEY = Thinning()
JUMP_S = 1e-3  # how long a change at once may last, in seconds
MIN_TURN = 1e-3  # normals that a blendshape turns by less than this are left out of it


@dataclass(frozen=True, eq=False)
class HeadTurn:
    """The rotation of a head about a place in its neck."""

    pivot: Array  # the place, in the frame of the mesh [shape=(3,)]
    share: Array  # how far each vertex turns with the head, 0 (the body) to 1 [shape=(V,)]
    rotations: Array  # unit quaternions x, y, z, w, one a frame of the weights; successive ones are near [shape=(T, 4)]


@dataclass(frozen=True, eq=False)
class Scene:
    """A character with its animation.

    mesh    : with blendshapes
    weights : of blendshapes over time, channels by their names; shapes without a channel stay at 0; None: no animation
    turn    : of the head; None: it stands still
    sound   : the file with the sound as the scene's file names it: a path from its folder, with slashes; empty: none
    sound_s : when the sound begins, in seconds of the animation; negative: it began before the animation
    metres  : the length of the mesh's unit in metres, for formats that say it
    original : the file that the mesh is from; a ``.glb`` of it keeps all that is in that file; None: no file
    stepped : names of weights that change at once from one held value to the next
    thinning : which keys of weights may be left out; the head's turn has all
    split   : whether vertices at one place share a normal, so that the seams along which files split them do not show
    Raises ExportError: a channel that is no blendshape. Raises InputError: a turn that does not fit the mesh.
    """

    mesh: Mesh
    weights: Motion | None = None
    turn: HeadTurn | None = None
    sound: str = ""
    sound_s: float = 0.0
    metres: float = 1.0
    original: Path | None = None
    split: bool = True
    stepped: tuple[str, ...] = ()
    thinning: Thinning = EVERY_KEY

    def __post_init__(self) -> None:
        for name in self.weights.names if self.weights else ():
            if name not in self.mesh.shape_names:
                raise ExportError(f"the mesh has no blendshape {name!r}; write the weights as .json")
        frames = len(self.weights.values) if self.weights else 0
        if self.turn is not None and (
            self.turn.share.shape != (len(self.mesh.vertices),) or self.turn.rotations.shape != (frames, 4)
        ):
            raise InputError(
                f"the head's turn is of {self.turn.share.shape} vertices and {self.turn.rotations.shape} frames, "
                f"required ({len(self.mesh.vertices)},) and ({frames}, 4)"
            )

    def tabulate(self) -> Array:
        """Return the weights of all blendshapes of the mesh, in their order [shape=(T, S)]; T is 0 without weights."""
        weights, names = self.weights, self.mesh.shape_names
        if weights is None:
            return np.zeros((0, len(names)))
        table = np.zeros((len(weights.values), len(names)))
        for column, name in enumerate(weights.names):
            table[:, names.index(name)] = weights.values[:, column]
        return table

    def list_keys(self) -> tuple[Array, Array]:
        """Return times in seconds [shape=(K,)], and the weights of all blendshapes at these [shape=(K, S)].

        Between two keys weights lie on a straight line: where some are stepped, there is a key just before a change.
        """
        time_s = self.weights.time_s if self.weights else np.zeros(0)
        stepped = [name in self.stepped for name in self.mesh.shape_names]
        return place_keys(time_s, self.tabulate(), stepped, self.thinning)


def with_jumps(time_s: Array, rows: Array, stepped: Sequence[bool]) -> tuple[Array, Array]:
    """Return evenly spaced keys with those added that let some curves change at once between straight lines.

    time_s  : seconds [shape=(T,)]; rows : of curves [shape=(T, N)]; stepped : which curves change at once [N values]
    An added key is ``JUMP_S`` before a change, or a tenth of the time between two keys, whichever is shorter.
    """
    chosen = np.array(stepped, bool)
    changed = np.flatnonzero(np.diff(rows[:, chosen], axis=0).any(axis=1)) + 1
    if not len(changed):
        return time_s, rows
    step_s = float(time_s[1] - time_s[0])
    early_s = min(JUMP_S, step_s / 10)
    before = rows[changed] - early_s / step_s * (rows[changed] - rows[changed - 1])
    before[:, chosen] = rows[changed - 1][:, chosen]
    return np.insert(time_s, changed, time_s[changed] - early_s), np.insert(rows, changed, before, axis=0)


def place_keys(time_s: Array, rows: Array, stepped: Sequence[bool], thinning: Thinning) -> tuple[Array, Array]:
    """Return times and values of keys, with straight lines between, of even rows; arguments as of ``with_jumps``."""
    all_s, all_rows = with_jumps(time_s, rows, stepped)
    chosen = thinning.choose(all_s, all_rows)
    return all_s[chosen], all_rows[chosen]


@dataclass(frozen=True, eq=False)
class ShadingNormals:
    """Normals of a mesh at rest [shape=(V, 3)], and vertices and changes of each blendshape [shape=(N,), (N, 3)]."""

    rest: Array
    turned: tuple[tuple[NDArray[np.int64], Array], ...]


def compute_shading_normals(mesh: Mesh, *, split: bool = True) -> ShadingNormals:
    """Return smooth normals of a mesh and of its blendshapes; ``split`` as of ``Scene``."""
    mesh = drop_back_sides(mesh)
    joined = build_surface(mesh).places if split else np.arange(len(mesh.vertices))
    triangles = joined[mesh.triangles].astype(np.int32)
    count = int(joined.max(initial=-1)) + 1
    rest = _join_normals(mesh.vertices, triangles, joined, count)
    turned = []
    for shape in mesh.shapes:
        moved = mesh.vertices.copy()
        moved[shape.rows] += shape.displacements
        near = np.zeros(count, bool)
        near[joined[shape.rows]] = True
        around = triangles[near[triangles].any(axis=1)]
        touched = np.zeros(count, bool)
        touched[around] = True
        wider = triangles[touched[triangles].any(axis=1)]
        change = _join_normals(moved, wider, joined, count) - rest
        rows = np.flatnonzero(touched[joined] & (np.abs(change).max(axis=1) > MIN_TURN))
        turned.append((rows.astype(np.int64), change[rows]))
    return ShadingNormals(rest, tuple(turned))


def _join_normals(vertices: Array, triangles: NDArray[np.int32], joined: NDArray[np.int64], count: int) -> Array:
    places = np.zeros((count, 3))
    places[joined] = vertices
    return np.asarray(compute_normals(places, triangles)[joined])
