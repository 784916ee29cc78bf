"""Teeth and tongue."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.head import palette
from lipmotion_faces.head.part import MOUTH_Y, Part, join, make_grid, make_part
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import ARCH, TEETH_EDGE, TEETH_Z, move_jaw

Real = NDArray[np.float64]

_UPPER_EDGES = (0.0, 0.062, 0.112, 0.155, 0.192, 0.224, 0.252, 0.274)
_LOWER_EDGES = (0.0, 0.036, 0.074, 0.114, 0.150, 0.183, 0.212, 0.236)
"""Where teeth touch their neighbours: distances from the middle, seen from the front."""
LOWER_EDGE = TEETH_EDGE + 0.006
"""Height of the edge of the lower incisors, behind the upper ones, when the jaw is closed."""
PARTED_TEETH = 0.035  # distance of the teeth behind closed lips
TIP_ON_LIP, TIP_HEIGHTS = 0.02, (TEETH_EDGE - 0.028, TEETH_EDGE - 0.013)
"""How far above the lower lip the middle of the tongue's tip is between the teeth, and the range of its height."""
_TONGUE_RINGS, _TONGUE_SIDES = 24, 32
TONGUE_TRIANGLES = make_grid(_TONGUE_RINGS, _TONGUE_SIDES, closed=True)[:, ::-1]


def make_upper_teeth() -> Part:
    """Return the upper teeth with a strip of gum."""
    return _make_row("upper teeth", _UPPER_EDGES, TEETH_EDGE, 0.115, 1.0, TEETH_Z)


def make_lower_teeth() -> Part:
    """Return the lower teeth with a strip of gum, the jaw closed."""
    return _make_row("teeth", _LOWER_EDGES, LOWER_EDGE, 0.095, -1.0, TEETH_Z - 0.045)


def _make_row(name: str, edges: tuple[float, ...], edge_y: float, height: float, up: float, front: float) -> Part:
    teeth = []
    for number, (near, far) in enumerate(pairwise(edges)):
        for side in (1, -1):
            teeth.append(_make_tooth(side * near, side * far, number, edge_y, height, up, front))
    x = np.linspace(-0.28, 0.28, 41)
    y = edge_y + up * height * np.array([0.72, 0.86, 1.3, 1.9])
    depth = np.array([-0.02, 0.004, 0.008, 0.0])
    grid = np.stack([np.tile(x, 4), np.repeat(y, 41), np.concatenate([front - ARCH * x**2 + d for d in depth])], axis=1)
    triangles = make_grid(4, 41)
    gum = make_part("gum", grid, triangles[:, ::-1] if up > 0 else triangles, palette.GUM, palette.TOOTH_FINISH)
    return join(name, [*teeth, gum])


def _make_tooth(a: float, b: float, number: int, edge_y: float, height: float, up: float, front: float) -> Part:
    """Return one tooth between two columns: a rounded plate that is bent over its edge."""
    across, down = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(0, 1, 9))
    half, middle = abs(b - a) / 2, (a + b) / 2
    x = middle + half * across
    shorter = (0.0, 0.005, 0.002, 0.006, 0.010, 0.013, 0.016)[number] if up > 0 else 0.004 * number
    rounded = 0.006 * np.maximum(np.abs(across) - 0.45, 0) ** 2 / 0.3
    level = np.clip(1 - down / 0.8, 0, 1)
    y = edge_y + up * (shorter + rounded + height * level)
    bulge = 0.012 * np.sqrt(np.maximum(1 - 0.75 * across**2, 0)) * np.sin(np.pi * (0.25 + 0.55 * (1 - level)))
    inward = 0.05 * np.clip((down - 0.8) / 0.2, 0, 1)
    tip = 0.012 * np.clip((down - 0.62) / 0.2, 0, 1) ** 2
    z = front - ARCH * x**2 - 0.012 + bulge - inward - tip
    places = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    colour = np.array(palette.TOOTH) * (1 - 0.05 * number)
    shade = np.clip(np.abs(across) - 0.8, 0, 1)[..., None] / 0.2 * 0.22
    root = (0.25 * level**3)[..., None]
    colours = (1 - shade) * colour + shade * np.array(palette.TOOTH_GAP)
    colours = (1 - root) * colours + root * np.array(palette.TOOTH_GAP)
    triangles = make_grid(9, 9)
    return make_part(
        "tooth", places, triangles if up > 0 else triangles[:, ::-1], colours.reshape(-1, 3), palette.TOOTH_FINISH
    )


def measure_drop(pose: CharacterPose) -> float:
    """Return how far the lower teeth drop with the jaw, a length; bitten together they touch the upper ones."""
    return pose.jaw + PARTED_TEETH * (1 - pose.bite) * (1 + max(pose.roundness, 1.4 * pose.oval))


def place_tongue(pose: CharacterPose) -> Real:
    """Return the places of the tongue from root to tip [shape=(V, 3)], the head not turned."""
    floor = LOWER_EDGE - 0.075
    root, body = np.array([0, floor - 0.05, -0.46]), np.array([0, floor + 0.060, -0.36])
    blade, tip = np.array([0, floor + 0.03, -0.22]), np.array([0, floor - 0.012, TEETH_Z - 0.085])
    points = move_jaw(np.stack([root, body, blade, tip]), pose.jaw + PARTED_TEETH * (1 - pose.bite))
    on_lip = MOUTH_Y - (pose.gap - pose.upper_rise) + TIP_ON_LIP
    tooth = np.array([0, np.clip(on_lip, *TIP_HEIGHTS), TEETH_Z + 0.115])
    ridge = np.array([0, TEETH_EDGE + 0.035, TEETH_Z - 0.075])
    for weight, to_tip, lift in ((pose.tongue_up, ridge, 0.01), (pose.tongue_out, tooth, -0.008)):
        points[3] += weight * (to_tip - points[3])
        points[2] += weight * (to_tip + np.array([0, lift - 0.035, -0.15]) - points[2])
        points[1, 1] += weight * 0.35 * max(to_tip[1] - 0.1 - points[1, 1], 0.0)
    share = np.sin(np.linspace(0, np.pi / 2, _TONGUE_RINGS))[:, None]
    spine = (
        (1 - share) ** 3 * points[0]
        + 3 * share * (1 - share) ** 2 * points[1]
        + 3 * share**2 * (1 - share) * points[2]
        + share**3 * points[3]
    )
    blunt = np.sqrt(np.clip(1 - np.clip((share - 0.45) / 0.55, 0, 1) ** 2.4, 0, 1)) + 1e-3
    wide = (0.195 - 0.045 * share) * blunt * (1 - 0.18 * pose.tongue_out)
    thick = (0.080 - (0.045 + 0.002 * pose.tongue_out) * share) * blunt**0.7
    angle = 2 * np.pi * np.arange(_TONGUE_SIDES) / _TONGUE_SIDES
    x = wide * np.cos(angle)
    groove = 0.10 * thick * np.exp(-((np.cos(angle) / 0.3) ** 2)) * (np.sin(angle) > 0)
    along = np.gradient(spine, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    up = np.stack([np.zeros(len(along)), along[:, 2], -along[:, 1]], axis=1)
    height = thick * np.sin(angle) - groove
    return np.asarray(spine[:, None] + x[..., None] * [1.0, 0, 0] + height[..., None] * up[:, None]).reshape(-1, 3)
