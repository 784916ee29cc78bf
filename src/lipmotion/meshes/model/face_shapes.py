"""The blendshapes of a mesh as the solver needs them: what each does to the lip and jaw points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, FACING
from lipmotion.meshes.model.mesh import Mesh

Array = NDArray[np.float64]
NOT_FROM_POINTS = {"tongueOut", "jawLeft", "jawRight", "mouthLeft", "mouthRight", "mouthShrugUpper", "mouthDimpleLeft"}
NOT_FROM_POINTS |= {"mouthDimpleRight", "jawForward", "mouthFrownLeft", "mouthFrownRight", "mouthPressLeft"}
NOT_FROM_POINTS |= {"mouthPressRight"}
"""Blendshapes of ARKit that speech hardly uses, or that points do not show; they stay 0, but for gestures."""
EYES_M, HEAD_M = 0.09, (0.18, 0.3)
"""People's distance between the outer corners of the eyes, and the range of heights from the chin to the top of a head
with its hair, in metres."""


@dataclass(frozen=True, eq=False)
class LipPlacement:
    """The vertex of each lip and jaw point, and how motion maps to the mesh.

    points   : numbers of the points, those of the template [52]
    vertices : the vertex of each [shape=(52,)]
    scale    : units of the mesh in one eye distance of motion: widths of the two mouths, divided
    axes     : the x, y and z of motion, as columns in the frame of the mesh [shape=(3, 3)]
    """

    points: tuple[int, ...]
    vertices: NDArray[np.int64]
    scale: float
    axes: Array

    def row(self, point: int) -> int:
        """Return the row of a point."""
        return self.points.index(point)

    def to_mesh(self, displacements: Array) -> Array:
        """Return displacements of motion, eye distances, in the mesh [shape=(..., 3), both]."""
        return self.scale * displacements @ self.axes.T

    def to_motion(self, displacements: Array) -> Array:
        """Return displacements of the mesh in eye distances of motion [shape=(..., 3), both]."""
        return displacements @ self.axes / self.scale


@dataclass(frozen=True, eq=False)
class FaceShapes:
    """Blendshapes of the mouth, as displacements of the points.

    names    : of the mesh, in the order of the weights [S]
    known    : ARKit's name of each, or else that of its viseme (``viseme_PP``) or vowel (``vowel_aa``), or ""
    moved    : displacements of the points at weight 1, eye distances, head frame [shape=(S, 52, 3)]
    gap      : how far each parts the middle of the inner lips, eye distances [shape=(S,)]
    style    : ``arkit``, ``visemes`` or ``own``
    """

    names: tuple[str, ...]
    known: tuple[str, ...]
    moved: Array
    gap: Array
    style: str

    def row(self, known: str) -> int | None:
        """Return the row of a blendshape by its known name, or None."""
        return self.known.index(known) if known in self.known else None

    def pairs(self) -> Array:
        """Return a row for each left shape with a right one: 1 and −1 [shape=(R, S)]."""
        rows = []
        for number, name in enumerate(self.known):
            other = self.row(name.removesuffix("Left") + "Right") if name.endswith("Left") else None
            if other is not None:
                row = np.zeros(len(self.known))
                row[[number, other]] = 1, -1
                rows.append(row)
        return np.array(rows).reshape(-1, len(self.known))


def find_life_scale(mesh: Mesh, placement: LipPlacement) -> float:
    """Return the length of an eye distance in units of a mesh: of a head as high as people's, theirs.

    The unit is the metre, the decimetre, the centimetre or another power of ten: the one in which the head is as high.
    Of a head of another size, it is that of the placement, which goes by the width of the mouth.
    """
    heights = mesh.vertices @ (placement.axes[:, 1] / np.linalg.norm(placement.axes[:, 1]))
    height = max(float(heights.max() - heights[placement.vertices[placement.row(CHIN)]]), 1e-12)
    unit = 10.0 ** np.floor(np.log10(height / HEAD_M[0]))
    return float(EYES_M * unit) if height / unit <= HEAD_M[1] else placement.scale


def measure_lip_parting(mesh: Mesh, placement: LipPlacement) -> Array:
    """Return how far each blendshape of a mesh parts the middle of the inner lips, eye distances [shape=(S,)]."""
    rows = [[placement.vertices[placement.row(point)] for point in pair] for pair in FACING[:3]]
    shifts = placement.to_motion(mesh.displacements(np.ravel(rows))).reshape(len(mesh.shapes), -1, 2, 3)
    gap = (shifts[:, :, 0, 1] - shifts[:, :, 1, 1]).mean(axis=1)
    return np.asarray(gap * placement.scale / find_life_scale(mesh, placement))


def group_by_name(mesh: Mesh, named: Callable[[str], str | None]) -> dict[str, list[int]]:
    """Return blendshapes' numbers by known names: a table's, then those with vertices of their own, largest first."""
    numbers: dict[str, list[int]] = {}
    for number, shape in enumerate(mesh.shapes):
        known = named(shape.called)
        if known is not None:
            numbers.setdefault(known, []).append(number)
    for known, same in numbers.items():
        same.sort(key=lambda each: (not mesh.shapes[each].source, -len(mesh.shapes[each].rows)))
        free, apart = np.ones(len(mesh.vertices), bool), list[int]()
        for each in same:
            rows = mesh.shapes[each].rows
            if mesh.shapes[each].source or (free[rows].all() and (len(rows) or not apart)):
                apart.append(each)
            free[rows] = False
        numbers[known] = apart
    return numbers
