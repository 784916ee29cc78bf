"""Weights of a character's own blendshapes, from solved ones and a table of gains and offsets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import LEAST_GAP
from lipmotion.meshes.files.rig_tables import RigRow, apply_rig
from lipmotion.meshes.fitting.lip_placement import LipPlacement
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes, measure_lip_parting
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.meshes.model.shape_names import arkit_name, spoken_name
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OwnCurves:
    """What moves the blendshapes of a mouth that has a table.

    rows   : of each blendshape; its source is the name of the solved shape (``FaceShapes.names``)
    parted : how far each parts the lips at weight 1, eye distances [shape=(R,)]
    """

    rows: tuple[RigRow, ...]
    parted: Array

    def weights(self, motion: Motion, units: Timeline[Unit], shapes: FaceShapes) -> Motion:
        """Return the weights of all blendshapes of the mouth, ``offset + gain · solved``, within their limits.

        Where the lips touch in solved weights they touch with these gains, too; elsewhere they are as far apart as the
        gains make them. What the offsets do to the lips, they do in every frame. Weights that the motion has for
        blendshapes by the mesh's names are such weights already, and stay.
        Raises InputError: as ``solve_shape_weights``.
        """
        parting = np.zeros(len(shapes.names))
        for row, parted in zip(self.rows, self.parted.tolist(), strict=True):
            parting[shapes.names.index(row.source)] += row.gain * parted
        given = self._given(motion)
        if given is not None:
            solved = solve_shape_weights(given, units, replace(shapes, gap=parting))
        else:
            solved = solve_shape_weights(motion, units, shapes)
            if any(row.gain != 1 for row in self.rows):
                weights = solved.values.astype(np.float64)
                gains = [row.gain for row in self.rows]
                before, after = weights @ shapes.gap, weights @ parting
                share = np.clip(after / np.maximum(before, 1e-9), min(gains), max(gains))
                # Closed after the gains where they closed the lips before.
                wanted = np.maximum(share * before, np.minimum(before, LEAST_GAP))
                solved = replace(
                    solved, values=with_gap(weights, replace(shapes, gap=parting), np.where(before > 0, wanted, before))
                )
        curves = dict(zip(shapes.names, solved.values.astype(np.float64).T, strict=True))
        moved = apply_rig(self.rows, curves, solved.rate_hz)
        return replace(moved, channels=tuple(Channel(name, WEIGHT) for name in moved.names))

    def _given(self, motion: Motion) -> Motion | None:
        """Return a motion with solved weights in place of those of blendshapes by the mesh's names; None: no such."""
        found: dict[str, Array] = {}
        for row in self.rows:
            if row.control in motion.names and row.gain and row.source not in found:
                found[row.source] = (motion[row.control].astype(np.float64) - row.offset) / row.gain
        if not found:
            return None
        kept = [name for name in motion.names if name not in {*found, *(row.control for row in self.rows)}]
        values = [motion[name] for name in kept] + list(found.values())
        channels = [motion.channels[motion.column(name)] for name in kept] + [Channel(name, WEIGHT) for name in found]
        return Motion(np.stack(values, axis=1), motion.rate_hz, tuple(channels))


def assign_own_curves(
    mesh: Mesh, placement: LipPlacement, shapes: FaceShapes, table: Mapping[str, RigRow]
) -> OwnCurves | None:
    """Return what moves the blendshapes of a mouth, from the rows of a table by its blendshapes; None: no table."""
    if not table:
        return None
    parted = measure_lip_parting(mesh, placement)
    numbers, rows = [], []
    for number, shape in enumerate(mesh.shapes):
        solved = _solved_name(shape, shapes)
        if solved is not None:
            numbers.append(number)
            rows.append(replace(table.get(shape.name, plain_row(shape.name, shape.name)), source=solved))
    return OwnCurves(tuple(rows), parted[numbers])


def plain_row(control: str, source: str) -> RigRow:
    """Return the row of a blendshape that follows a curve as it is."""
    return RigRow(control, source, low=0.0, high=1.0)


def list_rows(mesh: Mesh, shapes: FaceShapes | None, beside: Mapping[str, str]) -> Iterator[RigRow]:
    """Yield the rows of a table that change nothing: every blendshape of a mesh, with the curve that moves it.

    shapes : of its mouth;  beside : the curves of eyes and brows by blendshapes
    Blendshapes that nothing moves have an empty source.
    """
    for shape in mesh.shapes:
        solved = None if shapes is None else _solved_name(shape, shapes)
        source = beside.get(shape.name, "")
        if solved is not None and shapes is not None:
            source = shapes.known[shapes.names.index(solved)].removeprefix("vowel_") or shape.name
        yield plain_row(shape.name, source)


def _solved_name(shape: Blendshape, shapes: FaceShapes) -> str | None:
    """Return the name of the solved shape that a blendshape is, or is one of; None: it is none of the mouth."""
    if shape.name in shapes.names:
        return shape.name
    known = {arkit_name(shape.called), spoken_name(shape.called)} - {None} if shape.source else set()
    return next((name for name, each in zip(shapes.names, shapes.known, strict=True) if each in known), None)
