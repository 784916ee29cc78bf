"""The blendshapes of a mesh as the solver needs them: what each does to the lip and jaw points."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import CHIN, FACING
from lipmotion.errors import InputError, shortened
from lipmotion.meshes.fitting.lip_placement import LipPlacement
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, arkit_name, viseme_name, vowel_name

Array = NDArray[np.float64]

NOT_FROM_POINTS = {"tongueOut", "jawLeft", "jawRight", "mouthLeft", "mouthRight", "mouthShrugUpper", "mouthDimpleLeft"}
NOT_FROM_POINTS |= {"mouthDimpleRight", "jawForward", "mouthFrownLeft", "mouthFrownRight", "mouthPressLeft"}
NOT_FROM_POINTS |= {"mouthPressRight"}
"""Blendshapes of ARKit that speech hardly uses, or that points do not show; they stay 0, but for gestures."""
LEAST_DISPLACEMENT = 0.02
"""A blendshape that moves no lip point by this many eye distances is none of the mouth."""
MOST_SHAPES = 200
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


def life_scale(mesh: Mesh, placement: LipPlacement) -> float:
    """Return the length of an eye distance in units of a mesh that is in metres: of a head as high as people's, theirs.

    Of a head of another size, it is that of the placement, which goes by the width of the mouth.
    """
    heights = mesh.vertices @ (placement.axes[:, 1] / np.linalg.norm(placement.axes[:, 1]))
    height_m = float(heights.max() - heights[placement.vertices[placement.row(CHIN)]])
    return EYES_M if HEAD_M[0] <= height_m <= HEAD_M[1] else placement.scale


def face_shapes(
    mesh: Mesh, placement: LipPlacement, only: Collection[str] = (), *, in_metres: bool = False
) -> FaceShapes:
    """Return the blendshapes of a mesh that move the mouth.

    ARKit's, where the mesh has ``jawOpen`` and five more of them; otherwise visemes and vowels, where it has five;
    otherwise all that move lip points.
    only      : names of the mesh; empty: as above
    in_metres : whether the mesh is in metres; then one motion parts the lips by the same length on all heads that are
                as high as people's, however wide their mouths are
    Raises InputError: there is no such blendshape, or none that moves the mouth.
    """
    moved = placement.to_motion(mesh.displacements(placement.vertices))
    strong = np.abs(moved).max(axis=(1, 2), initial=0.0) > LEAST_DISPLACEMENT
    arkit = [arkit_name(name) or "" for name in mesh.shape_names]
    mouths = {name: n for n, name in enumerate(arkit) if name in ARKIT_MOUTH and len(mesh.shapes[n].rows)}
    if only:
        unknown = [name for name in only if name not in mesh.shape_names]
        if unknown:
            raise InputError(f"there is no blendshape {shortened(unknown[0])!r}; the mesh has {_listed(mesh)}")
        chosen, style = [mesh.shape_names.index(name) for name in only], "own"
        known = [arkit[number] for number in chosen]
        style = "arkit" if "jawOpen" in known else style
    elif "jawOpen" in mouths and strong[mouths["jawOpen"]] and len(mouths) > 5:
        chosen, known, style = list(mouths.values()), list(mouths), "arkit"
    else:
        chosen, known, style = _spoken(mesh, strong)
    if not chosen:
        raise InputError(f"no blendshape moves the mouth; the mesh has {_listed(mesh)}. Drive it by control points")
    if len(chosen) > MOST_SHAPES:
        raise InputError(f"{len(chosen)} blendshapes move the mouth, required at most {MOST_SHAPES}; name those to use")
    facing = [(placement.row(upper), placement.row(lower)) for upper, lower in FACING[:3]]
    gap = np.mean([moved[:, upper, 1] - moved[:, lower, 1] for upper, lower in facing], axis=0)
    if in_metres:
        gap = gap * placement.scale / life_scale(mesh, placement)
    return FaceShapes(tuple(mesh.shape_names[n] for n in chosen), tuple(known), moved[chosen], gap[chosen], style)


def _spoken(mesh: Mesh, strong: NDArray[np.bool_]) -> tuple[list[int], list[str], str]:
    """Return visemes or vowels, or else everything that moves the mouth: rows, known names, style."""
    for label, test, least in (("viseme", viseme_name, 8), ("vowel", vowel_name, 5)):
        found: dict[str, int] = {}
        for number, name in enumerate(mesh.shape_names):
            known = test(name)
            if known is not None and known != "sil" and (strong[number] or known == "PP"):
                found.setdefault(f"{label}_{known}", number)
        if len(found) >= least:
            return list(found.values()), list(found), "visemes"
    chosen = np.flatnonzero(strong).tolist()
    return chosen, [arkit_name(mesh.shape_names[number]) or "" for number in chosen], "own"


def _listed(mesh: Mesh) -> str:
    return shortened(", ".join(mesh.shape_names)) or "none"
