"""A user's own character that motion moves: the weights of its blendshapes, by its own table if there is one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import MIN_GAP
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes, LipPlacement, group_by_name, measure_lip_parting
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.rig_tables import RigRow, apply_rig
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, VRM_EMOTIONS, find_spoken_name, to_arkit
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

Array = NDArray[np.float64]


def _solve_with_table(
    motion: Motion, units: Timeline[Unit], shapes: FaceShapes, rows: Sequence[RigRow], parted: Array
) -> Motion:
    """Return a mouth's weights, ``offset + gain · solved``; lips that touch in solved weights touch in these, too."""
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


def list_rig_rows(mesh: Mesh, shapes: FaceShapes | None, others: Mapping[str, str]) -> Iterator[RigRow]:
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


@dataclass(frozen=True, eq=False)
class DrivenCharacter:
    """A mesh, where its lip points are, and the blendshapes that move it.

    shapes : the blendshapes of its mouth; None: it has none, and no weights
    table  : rows of the table beside its file, by blendshapes
    """

    mesh: Mesh
    placement: LipPlacement
    shapes: FaceShapes | None
    table: Mapping[str, RigRow] = field(default_factory=dict)

    def weights(self, motion: Motion, units: Timeline[Unit]) -> Motion:
        """Return blendshapes' weights over time, by the mesh's names. Raises InputError: it has none of the mouth."""
        if self.shapes is None:
            what = "the character is moved by control points and has no weights of blendshapes; write a video,"
            raise InputError(f"{what} or the motion without --character")
        if not self.table and not self.twins:
            return solve_shape_weights(motion, units, self.shapes)
        return _solve_with_table(motion, units, self.shapes, *self.mouth_rows)

    def table_rows(self) -> tuple[RigRow, ...]:
        """Return a full table of the character: its own rows, and for other blendshapes what moves them without one."""
        known = {shape.name: shape.called.lower() for shape in self.mesh.shapes}
        others = {name: called for name, called in known.items() if called in VRM_EMOTIONS}
        others |= {row.control: row.source for row in self.other_rows}
        known = {name: to_arkit(first) or find_spoken_name(first) or "" for name, first in self.twins.items()}
        others |= {name: source.removeprefix("vowel_") for name, source in known.items()}
        return tuple(self.table.get(row.control, row) for row in list_rig_rows(self.mesh, self.shapes, others))

    @cached_property
    def twins(self) -> dict[str, str]:
        """Blendshapes of further parts, as teeth, with the solved ones that they follow by their names."""
        groups = (*group_by_name(self.mesh, to_arkit).values(), *group_by_name(self.mesh, find_spoken_name).values())
        pairs = [(self.mesh.shapes[same[0]].name, self.mesh.shapes[n]) for same in groups for n in same[1:]]
        solved = self.shapes.names if self.shapes else ()
        return {other.name: first for first, other in pairs if first in solved and other.source is None}

    @cached_property
    def mouth_rows(self) -> tuple[tuple[RigRow, ...], Array]:
        """The rows that move the mouth, by solved names, and how far each parts the lips [shape=(R,)]."""
        parted, rows, numbers = measure_lip_parting(self.mesh, self.placement), list[RigRow](), list[int]()
        for number, shape in enumerate(self.mesh.shapes):
            first = self.twins.get(shape.name, "")
            solved = first or (_find_solved_name(shape, self.shapes) if self.shapes else None)
            if solved is not None:
                row = self.table.get(first or shape.name, make_plain_row(shape.name, shape.name))
                rows.append(replace(row, control=shape.name, source=solved))
                numbers.append(number)
        return tuple(rows), parted[numbers]

    @cached_property
    def other_rows(self) -> tuple[RigRow, ...]:
        """What moves ARKit's blendshapes of eyes and brows, in ARKit's order."""
        numbers = group_by_name(self.mesh, to_arkit)
        pairs = [(known, self.mesh.shapes[number]) for known in ARKIT_OTHERS for number in numbers.get(known, ())]
        return tuple(
            replace(self.table.get(shape.name, make_plain_row(shape.name, known)), source=known)
            for known, shape in pairs
            if len(shape.rows)
        )
