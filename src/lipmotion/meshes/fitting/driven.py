"""A user's own character that motion moves: a mesh with blendshapes or control points, from weights to vertices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import MIN_GAP, sample_pictures
from lipmotion.articulation.expression import read_moods
from lipmotion.articulation.lip_points import LOWER_MIDDLE, UPPER_MIDDLE
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights, weigh_expressions, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes, LipPlacement, group_by_name, measure_lip_parting
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.rig_tables import RigRow, apply_rig, find_table
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, VRM_EMOTIONS, find_spoken_name, to_arkit
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ControlBinding:
    """Weights of control points on the vertices of a mesh.

    placement : the control points: lip and jaw points of motion, each at a vertex
    rows      : the vertices that follow any of them, ascending [shape=(N,)]
    controls  : which control points a vertex follows, as rows of the placement; unused ones have weight 0
                [shape=(N, K)]
    weights   : how much, 0 to 1; what they leave of 1 is fixed to the head [shape=(N, K)]
    """

    placement: LipPlacement
    rows: Rows
    controls: Rows
    weights: Array

    @cached_property
    def matrix(self) -> csr_array:
        """The weights as sparse rows [shape=(N, C)]."""
        from scipy.sparse import csr_array

        starts = np.arange(0, self.controls.size + 1, self.controls.shape[1])
        shape = (len(self.rows), len(self.placement.points))
        return csr_array((self.weights.reshape(-1), self.controls.reshape(-1), starts), shape=shape)

    def moved(self, mesh: Mesh, displacements: Array) -> Array:
        """Return the vertices [shape=(V, 3)] under displacements of control points, eye distances [shape=(C, 3)]."""
        matrices = np.tile(np.eye(3, 4), (len(displacements), 1, 1))
        matrices[:, :, 3] = self.placement.to_mesh(displacements)
        return self.transformed(mesh, matrices)

    def transformed(self, mesh: Mesh, matrices: Array) -> Array:
        """Return the vertices [shape=(V, 3)] under transformations of the control points [shape=(C, 3, 4)].

        v′ = Σ wᵢ Mᵢ v + (1 − Σ wᵢ) v: the matrices are blended, then applied, which is the same and costs less.
        Source: Hofer 2008, Eq. 12.  Deviation: a fixed control point has what the weights leave of 1, so that the face
        beyond the mouth stands still.
        Cost: O(12 · (number of weights) + 12 N).
        """
        vertices, at_rest = mesh.vertices.copy(), mesh.vertices[self.rows]
        blended = (self.matrix @ (matrices - np.eye(3, 4)).reshape(len(matrices), 12)).reshape(-1, 3, 4)
        moved: Array = blended[:, :, 0] * at_rest[:, :1]
        moved += blended[:, :, 1] * at_rest[:, 1:2]
        moved += blended[:, :, 2] * at_rest[:, 2:]
        moved += blended[:, :, 3]
        vertices[self.rows] = moved + at_rest
        return vertices


def _solve_with_table(
    motion: Motion, units: Timeline[Unit], shapes: FaceShapes, rows: Sequence[RigRow], parted: Array
) -> Motion:
    """Return the weights of all blendshapes of a mouth, ``offset + gain · solved``, within their limits.

    Rows are those of ``_mouth_rows``. Where the lips touch in solved weights they touch with these gains, too.
    Offsets act in every frame. If the motion already has weights by the mesh's names, they stay.
    """
    parting = np.zeros(len(shapes.names))
    for row, parts in zip(rows, parted.tolist(), strict=True):
        parting[shapes.names.index(row.source)] += row.gain * parts
    scaled, stated = replace(shapes, gap=parting), dict[str, Array]()
    for row in rows:
        if row.control in motion.names and row.gain and row.source not in stated:
            stated[row.source] = (motion[row.control].astype(np.float64) - row.offset) / row.gain
    if stated:
        others = [name for name in motion.names if name not in {*stated, *(row.control for row in rows)}]
        values = np.stack([*(motion[name] for name in others), *stated.values()], axis=1)
        channels = [motion.channels[motion.column(name)] for name in others]
        channels += [Channel(name, WEIGHT) for name in stated]
        solved = solve_shape_weights(Motion(values, motion.rate_hz, tuple(channels)), units, scaled)
    else:
        solved = solve_shape_weights(motion, units, shapes)
    weights, gains = solved.values.astype(np.float64), [row.gain for row in rows]
    if not stated and set(gains) != {1}:
        before, after = weights @ shapes.gap, weights @ parting
        share = np.clip(after / np.maximum(before, 1e-9), min(gains), max(gains))
        # Closed after the gains where they closed the lips before.
        wanted = np.maximum(share * before, np.minimum(before, MIN_GAP))
        weights = with_gap(weights, scaled, np.where(before > 0, wanted, before))
    moved = apply_rig(rows, dict(zip(shapes.names, weights.T, strict=True)), solved.rate_hz)
    return replace(moved, channels=tuple(Channel(name, WEIGHT) for name in moved.names))


def make_plain_row(control: str, source: str) -> RigRow:
    """Return the row of a blendshape that follows a curve as it is."""
    return RigRow(control, source, low=0.0, high=1.0)


def list_rows(mesh: Mesh, shapes: FaceShapes | None, others: Mapping[str, str]) -> Iterator[RigRow]:
    """Yield a row that changes nothing for every blendshape of a mesh: its curve, or an empty source."""
    for shape in mesh.shapes:
        solved = None if shapes is None else _find_solved_name(shape, shapes)
        source = others.get(shape.name, "")
        if solved is not None and shapes is not None:
            source = shapes.known[shapes.names.index(solved)].removeprefix("vowel_") or shape.name
        yield make_plain_row(shape.name, source)


def _find_solved_name(shape: Blendshape, shapes: FaceShapes) -> str | None:
    """Return the name of the solved shape that a blendshape belongs to; None: it is not of the mouth."""
    if shape.name in shapes.names:
        return shape.name
    known = {to_arkit(shape.called), find_spoken_name(shape.called)} - {None} if shape.source else set()
    return next((name for name, each in zip(shapes.names, shapes.known, strict=True) if each in known), None)


class DrivenPose(NamedTuple):
    """What moves a character in one frame: weights of its mouth's shapes, or places' shifts [shape=(52, 3)]; others."""

    mouth: Array
    others: Array


@dataclass(frozen=True, eq=False)
class DrivenCharacter:
    """A mesh, where its lip points are, and what moves it: its own blendshapes, or else control points.

    shapes  : the blendshapes of its mouth; None: control points move it
    binding : weights of control points; None: blendshapes move it
    file    : where it was read from; None: from no file
    table   : rows of the table beside its file, by blendshapes
    """

    mesh: Mesh
    placement: LipPlacement
    shapes: FaceShapes | None
    binding: ControlBinding | None
    file: Path | None = None
    table: Mapping[str, RigRow] = field(default_factory=dict)

    def weights(self, motion: Motion, units: Timeline[Unit]) -> Motion:
        """Return blendshapes' weights over time, by the mesh's names. Raises InputError: it has none of the mouth."""
        if self.shapes is None:
            what = "the character is moved by control points and has no weights of blendshapes; write a video,"
            raise InputError(f"{what} or the motion without --character")
        if not self.table:
            return solve_shape_weights(motion, units, self.shapes)
        return _solve_with_table(motion, units, self.shapes, *self._mouth_rows)

    def poses(
        self, motion: Motion, units: Timeline[Unit], time_s: Array, others: Mapping[str, Array] | None = None
    ) -> list[DrivenPose]:
        """Return the pose at some times in seconds, evenly spaced, for ``place_vertices``.

        others : weights of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(T,)]; those that the mesh does
                 not have are left out; None: they stay at rest
        A closure between two times is shown at the nearer one (``articulation.contact.show_contact``).
        Raises InputError: as ``move_points``.
        """
        points = move_points(motion, units)
        other_rows = np.zeros((len(time_s), len(self._other_names)))
        for column, curve in enumerate(self.weigh_others(others or {}, len(time_s)).values()):
            other_rows[:, column] = curve
        moved, contact = points.expressed, points.mouth.contact
        if self.shapes is not None:
            moved = self.weights(motion, units).values.astype(np.float64)
        rows = sample_pictures(moved, contact, motion.rate_hz, time_s)
        moods = self.expressions(motion, points.mouth)
        if moods:
            table = np.stack([moods.get(name, np.zeros(len(contact))) for name in self._expressions.values()], axis=1)
            other_rows[:, len(self._other_rows) :] = sample_pictures(table, contact, motion.rate_hz, time_s)
        return list(map(DrivenPose, rows, other_rows))

    def expressions(self, motion: Motion, mouth: SpokenMouth) -> dict[str, Array]:
        """Return weights of VRM's expressions for moods, by the mesh's names [each shape=(T,)]; none parts p b m."""
        moods = weigh_expressions(read_moods(motion)) if self._expressions else {}
        upper, lower = (self.placement.vertices[self.placement.row(point)] for point in (UPPER_MIDDLE, LOWER_MIDDLE))
        curves = {}
        for name, shape in self._expressions.items():
            if name in moods:
                curve = self.table.get(shape, make_plain_row(shape, name)).alone(moods[name])
                shifts = self.placement.to_motion(self.mesh.displacements(np.array([upper, lower]), (shape,)))[0]
                curves[shape] = curve * mouth.free if shifts[0, 1] - shifts[1, 1] > MIN_GAP / 2 else curve
        return curves

    @cached_property
    def _expressions(self) -> dict[str, str]:
        """The mesh's names of VRM's expressions, by VRM's; none where it has ARKit's blendshapes of brows."""
        if {"browDownLeft", "browInnerUp", "browDownRight"} & {row.source for row in self._other_rows}:
            return {}
        by_name = {shape.called.lower(): shape.name for shape in self.mesh.shapes if len(shape.rows)}
        return {name: by_name[name] for name in VRM_EMOTIONS if name in by_name}

    def vertices(
        self, motion: Motion, units: Timeline[Unit], time_s: Array, others: Mapping[str, Array] | None = None
    ) -> Iterator[Array]:
        """Yield the vertices at some times [each shape=(V, 3)], as of ``poses``."""
        return map(self.place_vertices, self.poses(motion, units, time_s, others))

    def place_vertices(self, pose: DrivenPose) -> Array:
        """Return the vertices in a pose [shape=(V, 3)]. Raises InputError: no blendshapes of the mouth, no binding."""
        of_mouth, of_others = self._displacements
        if self.shapes is not None:
            vertices = self.mesh.vertices.copy()
            vertices[self.moving] += (pose.mouth @ of_mouth).reshape(-1, 3)
        elif self.binding is None:
            raise InputError("the character has neither blendshapes of the mouth nor a binding; give it a binding")
        else:
            vertices = self.binding.moved(self.mesh, pose.mouth)
        if pose.others.any():
            vertices[self.moving] += (pose.others @ of_others).reshape(-1, 3)
        return vertices

    @cached_property
    def moving(self) -> NDArray[np.int64]:
        """Numbers of the vertices that ever move, other than with the head, ascending [shape=(N,)]."""
        names = {*self._mouth_names, *self._other_names}
        rows = [shape.rows for shape in self.mesh.shapes if shape.name in names]
        if self.binding is not None:
            rows.append(self.binding.rows)
        return np.unique(np.concatenate(rows)) if rows else np.zeros(0, np.int64)

    def has_shape(self, known: str) -> bool:
        """Return whether the mesh has a blendshape of this ARKit name that moves something."""
        others = (row.source for row in self._other_rows)
        return known in others or (self.shapes is not None and known in self.shapes.known)

    def weigh_others(self, others: Mapping[str, Array], count: int) -> dict[str, Array]:
        """Return weights of eyes' and brows' blendshapes over ``count`` frames, by the mesh's names; missing: 0."""
        nothing = np.zeros(count)
        return {row.control: row.alone(others.get(row.source, nothing)) for row in self._other_rows}

    def table_rows(self) -> tuple[RigRow, ...]:
        """Return a full table of the character: its own rows, and for other blendshapes what moves them without one."""
        known = {shape.name: shape.called.lower() for shape in self.mesh.shapes}
        others = {name: called for name, called in known.items() if called in VRM_EMOTIONS}
        others |= {row.control: row.source for row in self._other_rows}
        return tuple(self.table.get(row.control, row) for row in list_rows(self.mesh, self.shapes, others))

    @property
    def table_file(self) -> Path:
        """Where the table of the character is. Raises InputError: it is from no file."""
        if self.file is None:
            raise InputError("the character was read from no file, so no table is beside it; read it from one")
        return find_table(self.file)

    @cached_property
    def _mouth_rows(self) -> tuple[tuple[RigRow, ...], Array]:
        """The rows that move the mouth, by solved names, and how far each parts the lips [shape=(R,)]."""
        parted, rows, numbers = measure_lip_parting(self.mesh, self.placement), list[RigRow](), list[int]()
        for number, shape in enumerate(self.mesh.shapes):
            solved = _find_solved_name(shape, self.shapes) if self.shapes else None
            if solved is not None:
                rows.append(replace(self.table.get(shape.name, make_plain_row(shape.name, shape.name)), source=solved))
                numbers.append(number)
        return tuple(rows), parted[numbers]

    @cached_property
    def _mouth_names(self) -> tuple[str, ...]:
        if self.shapes is None:
            return ()
        return tuple(dict.fromkeys(row.control for row in self._mouth_rows[0])) if self.table else self.shapes.names

    @cached_property
    def _other_rows(self) -> tuple[RigRow, ...]:
        """What moves ARKit's blendshapes of eyes and brows, in ARKit's order."""
        numbers = group_by_name(self.mesh, to_arkit)
        pairs = [(known, self.mesh.shapes[number]) for known in ARKIT_OTHERS for number in numbers.get(known, ())]
        return tuple(
            replace(self.table.get(shape.name, make_plain_row(shape.name, known)), source=known)
            for known, shape in pairs
            if len(shape.rows)
        )

    @cached_property
    def _other_names(self) -> tuple[str, ...]:
        return (*(row.control for row in self._other_rows), *self._expressions.values())

    @cached_property
    def _displacements(self) -> tuple[Array, Array]:
        """What blendshapes of the mouth, and all others, do to the moving vertices [shape=(S, N · 3), both]."""
        mouth, others = (
            self.mesh.displacements(self.moving, names).reshape(len(names), 3 * len(self.moving))
            for names in (self._mouth_names, self._other_names)
        )
        return mouth, others
