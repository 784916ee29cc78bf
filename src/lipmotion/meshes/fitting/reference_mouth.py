"""A mouth that has ARKit's blendshapes and nothing else: motion becomes ARKit's weights without any mesh.

The places are those of the template, the shapes are formulas on them: what ARKit's documentation shows of each
shape, in eye distances. docs/results/rig.md compares them with a scanned head's.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import FACING, mouth_template
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.other_shapes import VOWELS
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VRM_VOWELS

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]] | float

HINGE = (-0.45, -0.75)
"""The axis of the jaw: height and depth behind the eyes, in eye distances."""
JAW_ANGLE_RAD = 0.44
"""How far ``jawOpen`` turns the jaw: the lower lip goes down by about half an eye distance."""
UPPER_PART = 0.08
"""The share of the gap that the upper lip closes in ``mouthClose``; the lower lip closes the rest."""


@cache
def arkit_mouth() -> FaceShapes:
    """Return ARKit's blendshapes of the mouth as displacements of the lip and jaw points."""
    moved = np.array([_displacement(name) for name in ARKIT_MOUTH])
    template = mouth_template()
    facing = [(template.row(upper), template.row(lower)) for upper, lower in FACING[:3]]
    gap = np.mean([moved[:, upper, 1] - moved[:, lower, 1] for upper, lower in facing], axis=0)
    return FaceShapes(ARKIT_MOUTH, ARKIT_MOUTH, moved, gap, "arkit")


@cache
def vowel_mouth() -> FaceShapes:
    """Return the vowels of VRM, made of ARKit's blendshapes (``other_shapes.VOWELS``), as displacements of points."""
    mouth = arkit_mouth()
    gains = np.zeros((len(VRM_VOWELS), len(mouth.known)))
    for known, sources in VOWELS.items():
        for vowel, gain in sources:
            if vowel in VRM_VOWELS:
                gains[VRM_VOWELS.index(vowel), mouth.known.index(known)] = gain
    moved = np.einsum("vs,spd->vpd", gains, mouth.moved)
    return FaceShapes(VRM_VOWELS, tuple(f"vowel_{name}" for name in VRM_VOWELS), moved, gains @ mouth.gap, "visemes")


class _Regions:
    """Where the points are: 1 in the middle of a region, 0 outside it [each shape=(52,)]."""

    def __init__(self) -> None:
        template = mouth_template()
        self.places = template.places
        self.across = np.clip(self.places[:, 0] / (template.width / 2), -1.0, 1.0)
        middle = np.sqrt(1 - self.across**2)
        self.lips = (~template.jaw).astype(float)
        self.upper, self.lower = template.upper * middle, template.lower * middle
        self.edge = (~template.inner).astype(float) * self.lips
        self.corner = np.abs(self.across) ** 3 * self.lips
        self.jaw = template.jaw.astype(float)
        self.chin = self.jaw * np.exp(-((self.places[:, 0] / 0.3) ** 2))
        self.left, self.right = (np.clip(0.5 + 1.5 * side * self.across, 0, 1) for side in (1, -1))

    def side(self, name: str) -> Array:
        return self.left if name.endswith("Left") else self.right


def _displacement(name: str) -> Array:
    """Return how one blendshape moves the points at weight 1 [shape=(52, 3)]."""
    regions = _Regions()
    base = name.removesuffix("Left").removesuffix("Right") if name not in {"mouthLeft", "mouthRight"} else name
    if base == "jawOpen":
        return _jaw_open(regions)
    if base == "mouthClose":
        return _lips_together(regions)
    if base in {"jaw", "mouthLeft", "mouthRight"}:
        way = 0.15 if name.endswith("Left") else -0.15
        return np.outer((regions.jaw + 0.6 * regions.lower) if base == "jaw" else regions.lips, [way, 0, 0])
    moved = _FORMS[base](regions) if base in _FORMS else np.zeros_like(regions.places)
    sided = name != base
    return moved * regions.side(name)[:, None] if sided else moved


def _jaw_open(regions: _Regions) -> Array:
    """Return the jaw turned about its hinge; the lower lip follows it wholly, the corners by 0.45, the upper lip
    hardly."""
    share = regions.jaw + regions.lips * (0.45 + 0.55 * regions.lower - 0.45 * regions.upper)
    arm = regions.places[:, 1:] - HINGE
    turned = arm @ np.array(
        [
            [np.cos(JAW_ANGLE_RAD), np.sin(JAW_ANGLE_RAD)],
            [-np.sin(JAW_ANGLE_RAD), np.cos(JAW_ANGLE_RAD)],
        ]
    )
    moved = np.zeros_like(regions.places)
    moved[:, 1:] = share[:, None] * (turned - arm)
    moved[:, 0] = -0.06 * regions.across * (regions.lips - regions.upper) * (1 - regions.jaw)
    return moved


def _lips_together(regions: _Regions) -> Array:
    """Return the lips closed in front of the open jaw: the exact opposite of the gap that ``jawOpen`` makes."""
    jaw = _jaw_open(regions)
    inner = mouth_template().inner
    gaps = np.interp(regions.across, *_gap_across(jaw, regions))
    moved = np.zeros_like(jaw)
    lower = (mouth_template().lower).astype(float)
    upper = (mouth_template().upper).astype(float)
    softened = np.where(inner, 1.0, 0.9)
    moved[:, 1] = gaps * softened * ((1 - UPPER_PART) * lower - UPPER_PART * upper)
    moved[:, 2] = -0.9 * jaw[:, 2] * lower
    return moved


def _gap_across(jaw: Array, regions: _Regions) -> tuple[Array, Array]:
    """Return the gap that the open jaw makes, from the right corner to the left: where, and how large."""
    template = mouth_template()
    where, gaps = [-1.0, 1.0], [0.0, 0.0]
    for row in np.flatnonzero(template.upper & template.inner):
        below = np.flatnonzero(template.lower & template.inner)
        other = below[np.abs(template.places[below, 0] - template.places[row, 0]).argmin()]
        where.append(float(regions.across[row]))
        gaps.append(float(jaw[row, 1] - jaw[other, 1]))
    order = np.argsort(where, kind="stable")
    return np.array(where)[order], np.array(gaps)[order]


def _form(x: Real, y: Real, z: Real, regions: _Regions) -> Array:
    return np.stack([value * regions.lips for value in (x, y, z)], axis=1)


_FORMS: dict[str, Callable[[_Regions], Array]] = {
    "jawForward": lambda r: np.outer(r.jaw + 0.7 * r.lower, [0, 0, 0.16]),
    "mouthFunnel": lambda r: _form(-0.15 * r.across, 0.08 * r.upper - 0.12 * r.lower, 0.09 * (1 - r.corner), r),
    "mouthPucker": lambda r: _form(-0.15 * r.across, -0.01 * r.upper + 0.01 * r.lower, 0.10 * (1 - 0.6 * r.corner), r),
    "mouthSmile": lambda r: _form(0.14 * r.across, 0.14 * r.corner, -0.08 * r.corner, r),
    "mouthFrown": lambda r: _form(0.02 * r.across, -0.07 * r.corner, -0.01 * r.corner, r),
    "mouthDimple": lambda r: _form(0.06 * r.across, 0.01 * r.corner, -0.07 * r.corner, r),
    "mouthStretch": lambda r: _form(0.10 * r.across, -0.03 * r.corner, -0.04 * r.corner, r),
    "mouthRollLower": lambda r: _form(0, 0.07 * r.lower * r.edge, -0.11 * r.lower, r),
    "mouthRollUpper": lambda r: _form(0, -0.07 * r.upper * r.edge, -0.11 * r.upper, r),
    "mouthShrugLower": lambda r: _form(0, 0.09 * r.lower, 0.04 * r.lower, r) + np.outer(r.chin, [0, 0.12, 0.02]),
    "mouthShrugUpper": lambda r: _form(0, 0.075 * r.upper, 0.045 * r.upper, r),
    "mouthPress": lambda r: _form(0, 0.012 * r.lower - 0.012 * r.upper, -0.015 * (1 - r.corner), r),
    "mouthLowerDown": lambda r: _form(0, -0.11 * r.lower, -0.01 * r.lower, r),
    "mouthUpperUp": lambda r: _form(0, 0.12 * r.upper, 0.0, r),
}
"""The shapes that one formula gives; those of a side are weighted by how far a point is on it."""
