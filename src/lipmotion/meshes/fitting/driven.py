"""A character that motion moves: a mesh with blendshapes, or with control points, from its files to its vertices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import LEAST_GAP, sample_pictures
from lipmotion.articulation.expression import read_moods
from lipmotion.articulation.lip_points import LOWER_MIDDLE, UPPER_MIDDLE
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.errors import InputError
from lipmotion.meshes.files.binding_files import BINDING_SUFFIX, load_binding, read_points, read_weights
from lipmotion.meshes.files.character_files import read_character
from lipmotion.meshes.files.rig_tables import RigRow, read_character_table, table_path, with_sources
from lipmotion.meshes.fitting.facial_animation import expression_weights
from lipmotion.meshes.fitting.lip_placement import (
    LipPlacement,
    find_opening_shape,
    part_named_lips,
    place_lips_by_points,
    place_lips_by_shape,
)
from lipmotion.meshes.fitting.own_curves import OwnCurves, assign_own_curves, list_rows, plain_row
from lipmotion.meshes.fitting.point_motion import move_points
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights
from lipmotion.meshes.model.binding import ControlBinding, bind, paint_weights
from lipmotion.meshes.model.bones import JAW
from lipmotion.meshes.model.face_shapes import FaceShapes, find_face_shapes, numbers_by_name
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, VRM_EMOTIONS, arkit_name
from lipmotion.meshes.model.surface import build_surface
from lipmotion.types import Motion, Timeline, Unit

JAW_OPEN = "jawOpen"
WIDEST_RAD = np.radians(22.0)
"""How far a jaw turns at weight 1."""


def with_jaw(mesh: Mesh) -> Mesh:
    """Return a mesh whose mouth opens: one with a jaw bone gets the blendshape ``jawOpen``, where it has none.

    The blendshape is the movement of the jaw's vertices as the bone turns about the axis from ear to ear, on a straight
    way. A mesh that has a blendshape that opens the mouth, or no jaw bone, is returned as it is.
    """
    bone = next((bone for bone in mesh.bones if bone.kind == JAW), None)
    if bone is None or _opens(mesh):
        return mesh
    away = mesh.vertices[bone.rows] - bone.place
    cosine, sine = np.cos(WIDEST_RAD), np.sin(WIDEST_RAD)
    turned = away @ np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    shape = Blendshape(JAW_OPEN, bone.rows, bone.shares[:, None] * (turned - away))
    others = tuple(each for each in mesh.shapes if each.name != JAW_OPEN)
    return replace(mesh, shapes=(*others, shape))


def _opens(mesh: Mesh) -> bool:
    try:
        find_opening_shape(mesh)
    except InputError:
        return False
    return True


Array = NDArray[np.float64]


class DrivenPose(NamedTuple):
    """What moves a character in one frame.

    mouth  : weights of its blendshapes of the mouth [shape=(S,)], or displacements of points [shape=(52, 3)]
    others : weights of its blendshapes of eyes and brows [shape=(S',)]
    """

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
        """Return the weights of the blendshapes over time, channels by the names of the mesh, 0 to 1.

        Raises InputError: the character has no blendshapes of the mouth, or as ``solve_shape_weights``.
        """
        if self.shapes is None:
            raise InputError(
                "the character is moved by control points and has no weights of blendshapes; write a video, or the "
                "motion without --character"
            )
        if self._own_curves is None:
            return solve_shape_weights(motion, units, self.shapes)
        return self._own_curves.weights(motion, units, self.shapes)

    def poses(
        self, motion: Motion, units: Timeline[Unit], time_s: Array, others: Mapping[str, Array] | None = None
    ) -> list[DrivenPose]:
        """Return the pose at some times in seconds, evenly spaced, for ``posed``.

        others : weights of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(T,)]; those that the mesh does
                 not have are left out; None: they stay at rest
        A closure between two times is shown at the nearer one (``articulation.contact.show_contact``).
        Raises InputError: as ``move_points``.
        """
        points = move_points(motion, units)
        count = len(time_s)
        columns = [*self.beside(others or {}, count).values(), *(np.zeros(count) for _ in self._expressions)]
        beside = np.stack(columns, axis=1) if columns else np.zeros((count, 0))
        moved, contact = points.expressed, points.mouth.contact
        if self.shapes is not None:
            moved = self.weights(motion, units).values.astype(np.float64)
        rows = sample_pictures(moved, contact, motion.rate_hz, time_s)
        moods = self.expressions(motion, points.mouth)
        if moods:
            table = np.stack([moods.get(name, np.zeros(len(contact))) for name in self._expressions.values()], axis=1)
            beside[:, len(self._other_rows) :] = sample_pictures(table, contact, motion.rate_hz, time_s)
        return list(map(DrivenPose, rows, beside))

    def expressions(self, motion: Motion, mouth: SpokenMouth) -> dict[str, Array]:
        """Return the weights of whole expressions that stand for moods, by the mesh's names [each shape=(T,)].

        None, where the character has finer shapes, or no expressions. Those that part the lips vanish in p, b and m.
        """
        found = expression_weights(read_moods(motion)) if self._expressions else {}
        shown = [(name, own) for name, own in self._expressions.items() if name in found]
        curves = {own: self.table.get(own, plain_row(own, name)).alone(found[name]) for name, own in shown}
        return {
            own: curve * mouth.free if self._parted_by(own) > LEAST_GAP / 2 else curve for own, curve in curves.items()
        }

    def _parted_by(self, name: str) -> float:
        """Return how far a blendshape parts the middle of the lips, in eye distances."""
        moved = self.placement.to_motion(self.mesh.displacements(self.placement.vertices, (name,)))[0]
        return float(moved[self.placement.row(UPPER_MIDDLE), 1] - moved[self.placement.row(LOWER_MIDDLE), 1])

    @cached_property
    def _expressions(self) -> dict[str, str]:
        """The mesh's names of VRM's expressions, by VRM's; none where it has ARKit's blendshapes of brows."""
        if {"browDownLeft", "browInnerUp", "browDownRight"} & {row.source for row in self._other_rows}:
            return {}
        own = {shape.called.lower(): shape.name for shape in self.mesh.shapes if len(shape.rows)}
        return {name: own[name] for name in VRM_EMOTIONS if name in own}

    def vertices(
        self, motion: Motion, units: Timeline[Unit], time_s: Array, others: Mapping[str, Array] | None = None
    ) -> Iterator[Array]:
        """Yield the vertices at some times [each shape=(V, 3)], as of ``poses``."""
        return map(self.posed, self.poses(motion, units, time_s, others))

    def posed(self, pose: DrivenPose) -> Array:
        """Return the vertices in a pose [shape=(V, 3)]."""
        if self.shapes is not None:
            vertices = self.mesh.vertices.copy()
            vertices[self.moving] += (pose.mouth @ self._displacements).reshape(-1, 3)
            if pose.others.any():
                vertices[self.moving] += (pose.others @ self._others).reshape(-1, 3)
            return vertices
        vertices = self._binding.moved(self.mesh, pose.mouth)
        vertices[self.moving] += (pose.others @ self._others).reshape(-1, 3)
        return vertices

    @property
    def _binding(self) -> ControlBinding:
        """The weights of control points. Raises InputError: blendshapes move the character, and none of the mouth."""
        if self.binding is None:
            raise InputError("the character has neither blendshapes of the mouth nor a binding; give it a binding")
        return self.binding

    @cached_property
    def moving(self) -> NDArray[np.int64]:
        """The vertices that ever move, but for the turning of the head, ascending [shape=(N,)]."""
        names = {*self._mouth_names, *(row.control for row in self._other_rows), *self._expressions.values()}
        rows = [shape.rows for shape in self.mesh.shapes if shape.name in names]
        if self.binding is not None:
            rows.append(self.binding.rows)
        return np.unique(np.concatenate(rows)) if rows else np.zeros(0, np.int64)

    def has_shape(self, known: str) -> bool:
        """Return whether the mesh has a blendshape that moves something, by its name of ARKit."""
        others = (row.source for row in self._other_rows)
        return known in others or (self.shapes is not None and known in self.shapes.known)

    def beside(self, others: Mapping[str, Array], count: int) -> dict[str, Array]:
        """Return the weights of the blendshapes of eyes and brows over time, by the mesh's names [each shape=(T,)].

        others : weights of ARKit's blendshapes [each shape=(T,)]; those that are missing are 0;  count : of frames
        """
        nothing = np.zeros(count)
        return {row.control: row.alone(others.get(row.source, nothing)) for row in self._other_rows}

    def table_rows(self) -> tuple[RigRow, ...]:
        """Return the table of the character: the rows that it has, and for other blendshapes what moves them now."""
        beside = {
            shape.name: shape.called.lower() for shape in self.mesh.shapes if shape.called.lower() in VRM_EMOTIONS
        }
        beside |= {row.control: row.source for row in self._other_rows}
        found = list_rows(self.mesh, self.shapes, beside)
        return tuple(self.table.get(row.control, row) for row in found)

    @property
    def table_file(self) -> Path:
        """Where the table of the character is. Raises InputError: it is from no file."""
        if self.file is None:
            raise InputError("the character was read from no file, so no table is beside it; read it from one")
        return table_path(self.file)

    @cached_property
    def _own_curves(self) -> OwnCurves | None:
        return assign_own_curves(self.mesh, self.placement, self.shapes, self.table) if self.shapes else None

    @cached_property
    def _mouth_names(self) -> tuple[str, ...]:
        if self._own_curves is not None:
            return tuple(dict.fromkeys(row.control for row in self._own_curves.rows))
        return self.shapes.names if self.shapes else ()

    @cached_property
    def _other_rows(self) -> tuple[RigRow, ...]:
        """What moves ARKit's blendshapes of eyes and brows, in ARKit's order."""
        numbers = numbers_by_name(self.mesh, arkit_name)
        found = [(known, self.mesh.shapes[number]) for known in ARKIT_OTHERS for number in numbers.get(known, ())]
        return tuple(
            replace(self.table.get(shape.name, plain_row(shape.name, known)), source=known)
            for known, shape in found
            if len(shape.rows)
        )

    @cached_property
    def _displacements(self) -> Array:
        """What every blendshape of the mouth does to the moving vertices [shape=(S, N · 3)]."""
        return self._moved(self._mouth_names)

    @cached_property
    def _others(self) -> Array:
        """What the blendshapes of eyes and brows do to the moving vertices [shape=(S, N · 3)]."""
        return self._moved((*(row.control for row in self._other_rows), *self._expressions.values()))

    def _moved(self, names: Sequence[str]) -> Array:
        return self.mesh.displacements(self.moving, names).reshape(len(names), 3 * len(self.moving))


def load_character(
    path: str | Path, *, points: Path | None = None, binding: Path | None = None, by_points: bool = False
) -> DrivenCharacter:
    """Return a character from its files, ready to be moved; with the table beside it, if there is one.

    path      : ``.glb``, ``.gltf``, ``.vrm``, ``.obj``, or a folder of OBJ files
    points    : a table of the vertices of lip points; None: they are found by the blendshape that opens the mouth
    binding   : a binding file, or a table of painted weights (``.csv``); both mean control points
    by_points : move it by control points, though it has blendshapes
    Raises InputError: a file is damaged, or what moves the mouth is not found in it.
    Raises ModelFormatError: the binding is damaged.
    """
    path, mesh = Path(path), with_jaw(read_character(path))
    table = read_character_table(path, mesh)
    mesh = with_sources(mesh, table)
    is_stored = binding is not None and binding.suffix.lower() == BINDING_SUFFIX
    try:
        if is_stored and binding is not None:
            stored = load_binding(binding, mesh)
            return DrivenCharacter(mesh, stored.placement, None, stored, path, table)
        if points is not None:
            named = read_points(points)
            surface = part_named_lips(mesh, named)
            placement = place_lips_by_points(mesh, surface, named)
        else:
            surface = build_surface(mesh)
            placement = place_lips_by_shape(mesh, surface)
        if mesh.shapes and not by_points and binding is None:
            return DrivenCharacter(mesh, placement, find_face_shapes(mesh, placement), None, path, table)
        bound = bind(mesh, surface, placement)
        if binding is not None:
            bound = paint_weights(bound, mesh, read_weights(binding))
        return DrivenCharacter(mesh, placement, None, bound, path, table)
    except InputError as error:
        text = str(error)
        raise InputError(text if str(path) in text else f"{path}: {text}") from error
