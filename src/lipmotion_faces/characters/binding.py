"""Binding a character to control points by distance along its surface; bindings, and painted weights, in files.

Below: the vertices of a character in motion, moved by a binding or by its own blendshapes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import MIN_GAP, sample_pictures
from lipmotion.articulation.expression import read_moods
from lipmotion.articulation.lip_points import LOWER_MIDDLE, UPPER_MIDDLE, build_mouth
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.errors import InputError, ModelFormatError, shorten
from lipmotion.meshes.fitting.blendshape_motion import move_points
from lipmotion.meshes.fitting.driven import DrivenCharacter, make_plain_row
from lipmotion.meshes.fitting.shape_weights import weigh_expressions
from lipmotion.meshes.model.face_shapes import LipPlacement
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.rig_tables import find_table
from lipmotion.meshes.model.shape_names import VRM_EMOTIONS
from lipmotion.storage.archive import UNREADABLE, read_archive, read_header_of, write_archive
from lipmotion.storage.files import atomic_file
from lipmotion.storage.schema import ArraySpec, check_arrays, format_errors
from lipmotion.storage.sources import check_source
from lipmotion.storage.text_table import read_whole_table
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.types.values import parse_number, parse_whole
from lipmotion_faces.characters.file_limits import MAX_VERTICES
from lipmotion_faces.characters.surface import MeshSurface

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

    def move_vertices(self, mesh: Mesh, displacements: Array) -> Array:
        """Return the vertices [shape=(V, 3)] under displacements of control points, eye distances [shape=(C, 3)]."""
        matrices = np.tile(np.eye(3, 4), (len(displacements), 1, 1))
        matrices[:, :, 3] = self.placement.to_mesh(displacements)
        return self.transform_vertices(mesh, matrices)

    def transform_vertices(self, mesh: Mesh, matrices: Array) -> Array:
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


BINDING_FORMAT, BINDING_VERSION = "lipmotion.binding", 1
BINDING_SUFFIX = ".binding"
WEIGHT_COLUMNS = ("vertex", "point", "weight")
POINT_COLUMNS = ("point", "vertex")
LARGEST_TABLE_BYTES = 1 << 26
AGAIN = "bind the character again"
BINDING_ARRAYS = {
    "points": ArraySpec(np.int64, "C", 0, 1000),
    "vertices": ArraySpec(np.int64, "C", 0, MAX_VERTICES),
    "scale": ArraySpec(np.float64, "", 1e-12, 1e12),
    "axes": ArraySpec(np.float64, "3 3", -1.0001, 1.0001),
    "rows": ArraySpec(np.int64, "n", 0, MAX_VERTICES),
    "controls": ArraySpec(np.int64, "n K", 0, 1000),
    "weights": ArraySpec(np.float64, "n K", 0, 1),
    "vertex_count": ArraySpec(np.int64, "", 1, MAX_VERTICES),
}
"""The arrays of a binding file; fields of ``ControlBinding`` and ``LipPlacement``."""

UPPER_REACH, LOWER_REACH, JAW_REACH = 0.32, 0.45, 0.65
"""How far a control point of the upper lip and the corners, of the lower lip, of the jaw reaches along the surface, in
eye distances."""
MAX_WEIGHTS = 8  # most control points that a vertex follows
MIN_WEIGHT = 1e-3
VERTICES_AT_ONCE = 1 << 13
SOFTNESS = 0.03
"""Added to all distances, in eye distances: without it every control point would stick out of its surroundings."""
PLATEAU_SHARE = 0.4  # within this share of the reach of a control point nothing of a vertex is fixed to the head
JAW_FOLLOWERS = (152, 199, 200, 175)
"""What lies inside the mouth below the lips (lower teeth, tongue) follows the mean of these points."""
_CAVITY_REACH = 0.75  # the mouth's inside reaches so many eye distances back from the lips, and so far down


def bind(mesh: Mesh, surface: MeshSurface, placement: LipPlacement) -> ControlBinding:
    """Return the weights of the control points on a mesh, by distance along its surface.

    A control point acts within its reach: wᵢ ∝ ((Rᵢ − dᵢ) / (Rᵢ (dᵢ + s)))², normalised over the control points; all of
    them together fade out as the nearest one gets out of reach. Distances are measured along the surface, so the
    upper lip does not drag the lower, however near it is. Pieces inside the mouth below the lips follow the jaw as one.
    Source: Hofer 2008, Eq. 12, which gives no form of the weights; Franke & Nielson 1980 (modified Shepard weights).
    """
    template = build_mouth()
    reach = np.where(template.jaw, JAW_REACH, np.where(template.lower, LOWER_REACH, UPPER_REACH))[:, None]
    limit = float(reach.max()) * placement.scale
    distances = surface.place_distances(placement.vertices, limit)
    # pieces that lie inside the mouth, below where the lips meet: lower teeth, tongue
    places = mesh.vertices @ placement.axes / placement.scale
    lips = places[placement.vertices[~template.jaw]]
    centre, front = lips.mean(axis=0), float(lips[:, 2].max())
    across, up, _ = (places - centre).T
    within = (np.abs(across) < 0.6 * float(np.ptp(lips[:, 0]))) & (np.abs(up) < _CAVITY_REACH)
    within &= (places[:, 2] < front) & (places[:, 2] > front - 2 * _CAVITY_REACH)
    count = int(surface.pieces.max(initial=-1)) + 1
    sizes = np.bincount(surface.pieces, minlength=count)
    heights = np.bincount(surface.pieces, places[:, 1], count) / np.maximum(sizes, 1)
    covered = (np.bincount(surface.pieces[within], minlength=count) == sizes) & (heights < centre[1])
    covered[surface.pieces[placement.vertices]] = False
    inside = covered[surface.pieces]
    followers = np.array([placement.row(point) for point in JAW_FOLLOWERS])
    parts = []
    for first in range(0, len(mesh.vertices), VERTICES_AT_ONCE):
        rows = slice(first, first + VERTICES_AT_ONCE)
        far = np.minimum(distances[:, surface.places[rows]] / placement.scale, reach)
        pulls = ((reach - far) / (reach * (far + SOFTNESS))) ** 2
        out = np.clip((np.min(far / reach, axis=0) - PLATEAU_SHARE) / (1 - PLATEAU_SHARE), 0.0, 1.0)
        held = (1 - out) ** 2 * (1 + 2 * out)  # from 1 to 0, with slope 0 at both ends
        weights = (pulls / np.maximum(pulls.sum(axis=0), 1e-12) * held).T
        weights[inside[rows]] = 0.0
        weights[np.ix_(np.flatnonzero(inside[rows]), followers)] = 1 / len(JAW_FOLLOWERS)
        parts.append(_choose_strongest(weights, first))
    return ControlBinding(placement, *map(np.concatenate, zip(*parts, strict=True)))


def paint_weights(binding: ControlBinding, mesh: Mesh, paint: Mapping[int, Mapping[int, float]]) -> ControlBinding:
    """Return a binding with the weights of some vertices replaced.

    paint : for each vertex the weight of each point, 0 to 1; weights that add up to more than 1 are scaled down to 1
    Raises InputError: no such vertex or point, a weight out of its range, or too many points on a vertex.
    """
    points = binding.placement.points
    weights = np.zeros((len(mesh.vertices), len(points)))
    weights[binding.rows] = binding.matrix.toarray()
    for vertex, painted in paint.items():
        if not 0 <= vertex < len(mesh.vertices):
            raise InputError(f"the vertex {vertex} does not exist, required 0 to {len(mesh.vertices) - 1}")
        if sum(value > 0 for value in painted.values()) > MAX_WEIGHTS:
            raise InputError(f"the vertex {vertex} follows {len(painted)} points, required at most {MAX_WEIGHTS}")
        weights[vertex] = 0.0
        for point, value in painted.items():
            if point not in points:
                raise InputError(f"{point} is no control point, required one of {', '.join(map(str, points))}")
            if not 0 <= value <= 1:
                raise InputError(f"the weight of point {point} on vertex {vertex} is {value:g}, required 0 to 1")
            weights[vertex, binding.placement.row(point)] = value
        weights[vertex] /= max(float(weights[vertex].sum()), 1.0)
    return ControlBinding(binding.placement, *_choose_strongest(weights))


def _choose_strongest(weights: Array, first: int = 0) -> tuple[Rows, Rows, Array]:
    """Return rows from the first vertex on, controls and weights: the largest of each vertex [shape=(N, C)]."""
    total = weights.sum(axis=1)
    rows = np.flatnonzero(total > MIN_WEIGHT)
    controls = np.argsort(-weights[rows], axis=1, kind="stable")[:, :MAX_WEIGHTS]
    controls.sort(axis=1)
    strongest = np.take_along_axis(weights[rows], controls, axis=1)
    strongest *= (total[rows] / np.maximum(strongest.sum(axis=1), 1e-12))[:, None]  # they get what is left out
    return first + rows, controls.astype(np.int64), np.minimum(strongest, 1.0)


def save_binding(path: Path, binding: ControlBinding, mesh: Mesh) -> None:
    """Write a binding of a mesh to a file. Raises ExportError: it cannot be written."""
    placement = binding.placement
    arrays = {
        "points": np.array(placement.points, np.int64),
        "vertices": placement.vertices,
        "scale": np.array(placement.scale),
        "axes": placement.axes,
        "rows": binding.rows,
        "controls": binding.controls,
        "weights": binding.weights,
        "vertex_count": np.array(len(mesh.vertices)),
    }
    write_archive(path, {"format": BINDING_FORMAT, "version": BINDING_VERSION}, arrays)


def load_binding(path: Path, mesh: Mesh) -> ControlBinding:
    """Return the binding of a file. Raises InputError: no file, or another mesh. Raises ModelFormatError: damaged."""
    check_source(path, "binding")
    read_header_of(path, BINDING_FORMAT, BINDING_VERSION, "binding", AGAIN)
    try:
        with format_errors(f"{path}: the binding", AGAIN):
            arrays = check_arrays(read_archive(path), BINDING_ARRAYS)
    except UNREADABLE as error:
        raise ModelFormatError(f"{path}: not a binding ({shorten(str(error))}); {AGAIN}") from error
    count = int(arrays["vertex_count"])
    if count != len(mesh.vertices):
        raise InputError(f"{path}: made for {count} vertices, the character has {len(mesh.vertices)}; bind it again")
    template = build_mouth()
    with format_errors(f"{path}: the binding", AGAIN):
        if tuple(arrays["points"].tolist()) != template.points:
            raise ValueError("its points are not those of motion")
        if max(arrays["vertices"].max(), arrays["rows"].max(initial=0)) >= count:
            raise ValueError("it names vertices that do not exist")
        if arrays["controls"].max(initial=0) >= len(template.points) or arrays["controls"].shape[1] > MAX_WEIGHTS:
            raise ValueError("it names control points that do not exist")
        if (np.diff(arrays["rows"]) <= 0).any() or arrays["weights"].sum(axis=1).max(initial=0.0) > 1 + 1e-6:
            raise ValueError("its vertices are not in order, or weights are more than 1")
    placement = LipPlacement(template.points, arrays["vertices"], float(arrays["scale"]), arrays["axes"])
    return ControlBinding(placement, arrays["rows"], arrays["controls"], arrays["weights"])


def write_weights(path: Path, binding: ControlBinding) -> None:
    """Write the weights as a table ``vertex,point,weight``. Raises ExportError: it cannot be written."""
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(WEIGHT_COLUMNS) + "\n")
        for row, controls, weights in zip(binding.rows, binding.controls, binding.weights, strict=True):
            for control, weight in zip(controls.tolist(), weights.tolist(), strict=True):
                if weight > 0:
                    file.write(f"{row},{binding.placement.points[control]},{weight:.6g}\n")


def read_weights(path: Path) -> dict[int, dict[int, float]]:
    """Return a table of weights: for each vertex that it names, the weight of each point; for ``paint_weights``.

    A vertex that follows nothing has one row, with any point and weight 0.
    Raises InputError: no such file, other columns, a row that is damaged, or a vertex and point that occur twice.
    """
    paint: dict[int, dict[int, float]] = {}
    for number, row in _read_rows(path, WEIGHT_COLUMNS, "table of weights"):
        vertex, point = (parse_whole(text, f"{path}: line {number}: the number of a point is") for text in row[:2])
        weights = paint.setdefault(vertex, {})
        if point in weights:
            raise InputError(f"{path}: line {number}: vertex {vertex} and point {point} occur twice; remove one")
        weights[point] = parse_number(row[2], f"{path}: line {number}: the weight is", finite=False)
    return paint


def write_points(path: Path, placement: LipPlacement) -> None:
    """Write the vertex of each lip and jaw point, ``point,vertex``. Raises ExportError: it cannot be written."""
    with atomic_file(path) as unfinished, unfinished.open("w", encoding="ascii", newline="\n") as file:
        file.write(",".join(POINT_COLUMNS) + "\n")
        rows = zip(placement.points, placement.vertices, strict=True)
        file.writelines(f"{point},{vertex}\n" for point, vertex in rows)


def read_lip_points(path: Path) -> dict[int, int]:
    """Return the vertices of lip points from a table ``point,vertex``, for ``place_lips_by_points``.

    Raises InputError: no such file, other columns, a row that is damaged, or a point that occurs twice.
    """
    named: dict[int, int] = {}
    for number, row in _read_rows(path, POINT_COLUMNS, "table of lip points"):
        point, vertex = (parse_whole(text, f"{path}: line {number}: the number of a point is") for text in row)
        if point in named:
            raise InputError(f"{path}: line {number}: the point {point} occurs twice; remove one")
        named[point] = vertex
    return named


def _read_rows(path: Path, columns: tuple[str, ...], kind: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a table with their line numbers; empty lines and lines that begin with # are left out."""
    names, rows = read_whole_table(path, kind, LARGEST_TABLE_BYTES, columns)
    if names != list(columns):
        raise InputError(f"{path}: the columns are {shorten(','.join(names))!r}, required {','.join(columns)}")
    for line, row in rows:
        if not row[0].startswith("#"):
            if len(row) != len(columns):
                raise InputError(f"{path}: line {line}: {len(row)} columns, required {','.join(columns)}")
            yield line, row


class DrivenPose(NamedTuple):
    """What moves a character in one frame: weights of its mouth's shapes, or places' shifts [shape=(52, 3)]; others."""

    mouth: Array
    others: Array


@dataclass(frozen=True, eq=False)
class PosedCharacter(DrivenCharacter):
    """A character whose vertices move, by its own blendshapes or else by control points.

    file    : where it was read from; None: from no file
    binding : weights of control points; None: blendshapes move it
    """

    file: Path | None = None
    binding: ControlBinding | None = None

    @property
    def table_file(self) -> Path:
        """Where the table of the character is. Raises InputError: it is from no file."""
        if self.file is None:
            raise InputError("the character was read from no file, so no table is beside it; read it from one")
        return find_table(self.file)

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
            other_rows[:, len(self.other_rows) :] = sample_pictures(table, contact, motion.rate_hz, time_s)
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
        if {"browDownLeft", "browInnerUp", "browDownRight"} & {row.source for row in self.other_rows}:
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
            vertices = self.binding.move_vertices(self.mesh, pose.mouth)
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
        others = (row.source for row in self.other_rows)
        return known in others or (self.shapes is not None and known in self.shapes.known)

    def weigh_others(self, others: Mapping[str, Array], count: int) -> dict[str, Array]:
        """Return weights of eyes' and brows' blendshapes over ``count`` frames, by the mesh's names; missing: 0."""
        nothing = np.zeros(count)
        return {row.control: row.alone(others.get(row.source, nothing)) for row in self.other_rows}

    @cached_property
    def _mouth_names(self) -> tuple[str, ...]:
        if self.shapes is None or not (self.table or self.twins):
            return self.shapes.names if self.shapes else ()
        return tuple(dict.fromkeys(row.control for row in self.mouth_rows[0]))

    @cached_property
    def _other_names(self) -> tuple[str, ...]:
        return (*(row.control for row in self.other_rows), *self._expressions.values())

    @cached_property
    def _displacements(self) -> tuple[Array, Array]:
        """What blendshapes of the mouth, and all others, do to the moving vertices [shape=(S, N · 3), both]."""
        mouth, others = (
            self.mesh.displacements(self.moving, names).reshape(len(names), 3 * len(self.moving))
            for names in (self._mouth_names, self._other_names)
        )
        return mouth, others
