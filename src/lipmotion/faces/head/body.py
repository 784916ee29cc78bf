"""Ears, neck, shoulders and clothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.head import palette
from lipmotion.faces.head.part import Part, grid_triangles, part, tube

Real = NDArray[np.float64]

_SIDES = 64


def ear() -> Part:
    """Return the left ear."""
    around = 2 * np.pi * np.arange(48) / 48
    ring = np.array([0.0, 0.22, 0.42, 0.58, 0.70, 0.79, 0.87, 0.94, 1.0, 1.0, 0.93, 0.75])
    relief = np.array([-0.028, -0.03, -0.03, -0.022, 0.008, -0.006, 0.012, 0.03, 0.012, -0.02, -0.05, -0.09])
    outline = np.where(np.sin(around) > 0, 0.215, 0.235)
    wide = 0.145 * (1 + 0.18 * np.sin(around)) * np.where(np.cos(around) > 0, 1.0, 0.62)
    u = ring[:, None] * wide * np.cos(around)
    v = ring[:, None] * outline * np.sin(around)
    soft = np.where(np.sin(around) < -0.75, 0.4, 1.0)
    w = relief[:, None] * np.where(ring[:, None] > 0.6, soft, 1.0) * np.ones(48)
    w = w + 0.02
    turn = 0.95
    back, out = np.array([np.sin(turn) * 0.9, 0.10, -np.cos(turn)]), np.array([np.cos(turn), 0, np.sin(turn)])
    up = np.array([0.14, 1.0, -0.10])
    places = np.array([0.80, -0.20, -0.80]) + u[..., None] * back + v[..., None] * up + w[..., None] * out
    colours = np.broadcast_to(np.array(palette.SKIN), places.shape).copy()
    warm = np.exp(-(((ring - 0.4) / 0.3) ** 2))[:, None, None] * 0.35 + 0.15
    colours = (1 - warm) * colours + warm * np.array(palette.BLUSH)
    triangles = grid_triangles(len(ring), 48, closed=True)
    return part("ear", places.reshape(-1, 3), triangles, colours.reshape(-1, 3), palette.SKIN_FINISH)


def earring() -> Part:
    """Return the left ear's ring, a small ball."""
    down, around = np.meshgrid(np.linspace(0, np.pi, 12), 2 * np.pi * np.arange(20) / 20, indexing="ij")
    ball = np.stack([np.sin(down) * np.cos(around), np.cos(down), np.sin(down) * np.sin(around)], axis=-1)
    places = 0.035 * ball.reshape(-1, 3) + np.array([0.835, -0.455, -0.74])
    return part("earring", places, grid_triangles(12, 20, closed=True)[:, ::-1], palette.EARRING, palette.METAL_FINISH)


def _rings(table: Real) -> Real:
    """Return rings about the body from rows (height, half width, half depth, middle z, squareness)."""
    around = 2 * np.pi * np.arange(_SIDES) / _SIDES
    rows = []
    for y, wide, deep, z, square in table:
        power = 2 / square
        c, s = np.cos(around), np.sin(around)
        rows.append(
            np.stack(
                [
                    wide * np.sign(c) * np.abs(c) ** power,
                    np.full(_SIDES, y),
                    z + deep * np.sign(s) * np.abs(s) ** power,
                ],
                axis=1,
            )
        )
    return np.stack(rows)


def _between(table: Sequence[tuple[float, ...]], count: int) -> Real:
    from scipy.interpolate import PchipInterpolator

    knots = np.array(table)
    at = np.linspace(0, len(table) - 1, count)
    return np.asarray(PchipInterpolator(np.arange(len(table)), knots)(at))


def neck() -> Part:
    """Return the neck, from under the hair to under the collar."""
    rings = _rings(
        _between(
            [
                (-0.55, 0.33, 0.30, -0.98, 2),
                (-1.0, 0.355, 0.34, -0.96, 2),
                (-1.45, 0.375, 0.36, -0.98, 2),
                (-1.75, 0.47, 0.40, -1.0, 2),
                (-1.95, 0.75, 0.45, -1.0, 2),
            ],
            26,
        )
    )
    colours = np.broadcast_to(np.array(palette.SKIN), (rings.size // 3, 3)).copy()
    return part(
        "neck", rings.reshape(-1, 3), grid_triangles(26, _SIDES, closed=True)[:, ::-1], colours, palette.SKIN_FINISH
    )


def clothing() -> Part:
    """Return the pullover: shoulders and chest."""
    table = [
        (-1.60, 0.47, 0.44, -0.98, 2.0), (-1.66, 0.56, 0.50, -0.99, 2.0), (-1.78, 0.86, 0.56, -1.0, 2.05),
        (-1.92, 1.28, 0.60, -1.02, 2.1), (-2.08, 1.58, 0.62, -1.03, 2.15), (-2.35, 1.74, 0.66, -1.03, 2.2),
        (-2.8, 1.80, 0.72, -1.03, 2.2), (-3.4, 1.80, 0.75, -1.03, 2.2),
    ]  # fmt: skip
    rings = _rings(_between(table, 28))
    return part(
        "clothing",
        rings.reshape(-1, 3),
        grid_triangles(28, _SIDES, closed=True)[:, ::-1],
        palette.CLOTH,
        palette.CLOTH_FINISH,
    )


def collar() -> Part:
    """Return the ribbed collar."""
    around = 2 * np.pi * np.arange(121) / 120
    path = np.stack([0.475 * np.cos(around), -1.60 - 0.09 * np.sin(around), -0.98 + 0.44 * np.sin(around)], axis=1)
    upward = np.stack([np.cos(around), np.full(121, 0.35), np.sin(around)], axis=1)
    rib = 1 + 0.04 * np.cos(30 * around)
    places, triangles, _ = tube(path, 0.075 * np.ones(121), 0.05 * rib, upward, sides=10)
    return part("collar", places, triangles, palette.CLOTH_RIB, palette.CLOTH_FINISH)
