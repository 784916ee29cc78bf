"""The blendshapes of a mesh as the solver needs them: what each does to the lip and jaw points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, FACING
from lipmotion.errors import InputError, shorten
from lipmotion.meshes.fitting.lip_placement import LipPlacement
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, find_spoken_name, to_arkit

Array = NDArray[np.float64]

NOT_FROM_POINTS = {"tongueOut", "jawLeft", "jawRight", "mouthLeft", "mouthRight", "mouthShrugUpper", "mouthDimpleLeft"}
NOT_FROM_POINTS |= {"mouthDimpleRight", "jawForward", "mouthFrownLeft", "mouthFrownRight", "mouthPressLeft"}
NOT_FROM_POINTS |= {"mouthPressRight"}
"""Blendshapes of ARKit that speech hardly uses, or that points do not show; they stay 0, but for gestures."""
MIN_DISPLACEMENT = 0.02
"""A blendshape that moves no lip point by this many eye distances is none of the mouth."""
MAX_SHAPES = 200
EYES_M, HEAD_M = 0.09, (0.18, 0.3)
"""People's distance between the outer corners of the eyes, and the range of heights from the chin to the top of a head
with its hair, in metres."""


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


def find_face_shapes(mesh: Mesh, placement: LipPlacement) -> FaceShapes:
    """Return the blendshapes of a mesh that move the mouth.

    Visemes and vowels, where a table says what follows them; ARKit's, where the mesh has ``jawOpen`` and five more of
    them; otherwise eight visemes or three vowels; otherwise all that move lip points. Blendshapes that a table lets
    follow one curve are one of these shapes, by the name of the first.
    One motion parts the lips by the same length on all heads that are as high as people's, however wide their mouths.
    Raises InputError: none moves the mouth, or a table lets some follow visemes and others ``jawOpen``.
    """
    moved = placement.to_motion(mesh.displacements(placement.vertices))
    strong = np.abs(moved).max(axis=(1, 2), initial=0.0) > MIN_DISPLACEMENT
    shapes, style = _choose_mouth(mesh, strong)
    if not shapes:
        there = shorten(", ".join(mesh.shape_names)) or "none"
        raise InputError(f"no blendshape moves the mouth; the mesh has {there}. Drive it by control points")
    if len(shapes) > MAX_SHAPES:
        raise InputError(
            f"{len(shapes)} blendshapes move the mouth, required at most {MAX_SHAPES}; leave some empty in its table "
            "(docs/meshes.md)"
        )
    names = tuple(mesh.shape_names[numbers[0]] for _, numbers in shapes)
    gap = measure_lip_parting(mesh, placement)
    return FaceShapes(
        names,
        tuple(known for known, _ in shapes),
        np.stack([moved[numbers].sum(axis=0) for _, numbers in shapes]),
        np.array([gap[numbers].sum() for _, numbers in shapes]),
        style,
    )


def measure_lip_parting(mesh: Mesh, placement: LipPlacement) -> Array:
    """Return how far each blendshape of a mesh parts the middle of the inner lips, eye distances [shape=(S,)]."""
    rows = [[placement.vertices[placement.row(point)] for point in pair] for pair in FACING[:3]]
    moved = placement.to_motion(mesh.displacements(np.ravel(rows))).reshape(len(mesh.shapes), -1, 2, 3)
    gap = (moved[:, :, 0, 1] - moved[:, :, 1, 1]).mean(axis=1)
    return np.asarray(gap * placement.scale / find_life_scale(mesh, placement))


def group_by_name(mesh: Mesh, named: Callable[[str], str | None]) -> dict[str, list[int]]:
    """Return the numbers of blendshapes by the names they are understood as: a table's, or the first that moves
    something.
    """
    numbers: dict[str, list[int]] = {}
    for number, shape in enumerate(mesh.shapes):
        known = named(shape.called)
        if known is not None:
            numbers.setdefault(known, []).append(number)
    stated = {known: [each for each in same if mesh.shapes[each].source] for known, same in numbers.items()}
    first = {known: min(same, key=lambda each: not len(mesh.shapes[each].rows)) for known, same in numbers.items()}
    return {known: stated[known] or [first[known]] for known in numbers}


def _choose_mouth(mesh: Mesh, strong: NDArray[np.bool_]) -> tuple[list[tuple[str, list[int]]], str]:
    """Return the known names of the shapes of the mouth with their blendshapes, and their style."""
    spoken = group_by_name(mesh, find_spoken_name)
    arkit = {
        known: numbers
        for known, numbers in group_by_name(mesh, to_arkit).items()
        if known in ARKIT_MOUTH and len(mesh.shapes[numbers[0]].rows)
    }
    jaw = arkit.get("jawOpen", [])
    stated = [known for known, numbers in spoken.items() if mesh.shapes[numbers[0]].source]
    if stated and any(mesh.shapes[number].source for number in jaw):
        raise InputError(
            f"its table has jawOpen and {stated[0].removeprefix('vowel_')}; leave the sources of one kind empty"
        )
    if stated:
        return [(known, spoken[known]) for known in stated], "visemes"
    if strong[jaw].any() and len(arkit) > 5:
        return list(arkit.items()), "arkit"
    for kind, enough in (("viseme_", 8), ("vowel_", 3)):
        those = {
            known: numbers
            for known, numbers in spoken.items()
            if known.startswith(kind) and (strong[numbers].any() or known == "viseme_PP")
        }
        if len(those) >= enough:
            return list(those.items()), "visemes"
    moving = [(known, numbers) for known, numbers in arkit.items() if strong[numbers].any()]
    named = {number for _, numbers in moving for number in numbers}
    others = [number for number in np.flatnonzero(strong).tolist() if mesh.shapes[number].called]
    moving += [("", [number]) for number in others if number not in named]
    return sorted(moving, key=lambda each: each[1]), "own"
