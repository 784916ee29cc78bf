"""Hair that is swept back into a bun, with a fringe to one side and loose strands before the ears."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from lipmotion_faces.head import palette
from lipmotion_faces.head.forms import MIDDLE, head, seen_from_middle
from lipmotion_faces.head.part import Part, grid_triangles, join_parts, part, tube
from lipmotion_faces.rendering.lighting import unit

Real = NDArray[np.float64]

BUN = np.array([0.0, 1.40, -0.98])
"""Middle of the bun."""
_LINE = (
    (0.0, 0.78, 0.0), (0.30, 0.76, -0.04), (0.54, 0.64, -0.14), (0.69, 0.44, -0.26), (0.74, 0.20, -0.40),
    (0.76, -0.02, -0.52), (0.80, -0.10, -0.68), (0.82, 0.02, -0.80), (0.82, -0.12, -0.98), (0.72, -0.50, -1.16),
    (0.42, -0.70, -1.26), (0.0, -0.74, -1.28),
)  # fmt: skip
"""About where the hair begins, from the middle of the forehead round the left ear to the nape."""
_FRINGE = (
    (-0.74, 0.06, -0.42, 0.10), (-0.70, 0.24, -0.36, 0.115), (-0.60, 0.40, -0.24, 0.115), (-0.45, 0.52, -0.12, 0.10),
    (0.72, 0.16, -0.38, 0.09), (0.64, 0.36, -0.28, 0.095), (0.50, 0.52, -0.14, 0.085),
)  # fmt: skip
"""Where the locks of the fringe end, and how wide they are; all begin at the parting."""
_STRAND = (
    (0.77, 0.16, -0.46, 0.02), (0.80, -0.08, -0.42, 0.05), (0.74, -0.36, -0.36, 0.07), (0.66, -0.62, -0.40, 0.11),
    (0.66, -0.84, -0.40, 0.20),
)  # fmt: skip
"""A loose strand before the left ear."""
_COLUMNS, _ROWS = 270, 30


def hair() -> Part:
    """Return all the hair."""
    locks = [_lock(_STRAND, 0.034, 0.02, 0.1), _lock([(-x, *rest) for x, *rest in _STRAND], 0.034, 0.02, 0.1)]
    fringe = []
    for n, (x, y, z, wide) in enumerate(_FRINGE):
        start = 0.24 + 0.015 * n
        points = [
            (start, 0.97, -0.2, -0.03),
            (start + 0.12 * x, 0.90, -0.02, 0.10),
            (0.5 * (start + x), 0.74 - 0.06 * abs(x), -0.03, 0.115),
            (0.97 * x, y + 0.20, z + 0.08, 0.08),
            (1.02 * x, y - 0.06, z - 0.06, 0.035),
        ]
        fringe.append(_lock(points, wide, 0.05, 0.22 * (-1) ** n))
    return join_parts("hair", [_cap(), _bun(), *fringe, *locks])


def _cap() -> Part:
    half_loop = np.array(_LINE)
    loop = np.concatenate([half_loop, half_loop[-2:0:-1] * [-1, 1, 1], half_loop[:1]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
    curve = CubicSpline(length, loop, bc_type="periodic")(np.arange(_COLUMNS) / _COLUMNS * length[-1])
    line = seen_from_middle(head, unit(curve - MIDDLE))  # where the hair begins, clockwise from above
    start, pole = unit(line - MIDDLE), unit(BUN - MIDDLE)
    share = np.linspace(0, 1, _ROWS)[:, None, None] ** 1.15
    angle = np.arccos(np.clip(start @ pole, -1, 1))[None, :, None]
    ways = (np.sin((1 - share) * angle) * start + np.sin(share * angle) * pole) / np.sin(angle)
    skin = seen_from_middle(head, ways.reshape(-1, 3)).reshape(ways.shape)
    phase = 2 * np.pi * np.arange(_COLUMNS) / _COLUMNS
    share = share[..., 0]
    wave = 0.5 * np.sin(23 * phase + 2 * np.sin(3 * phase)) + 0.3 * np.sin(41 * phase + 1.3) + 0.2 * np.sin(67 * phase)
    ridge = np.asarray(1 - 2 * np.abs(wave) ** 0.8)  # grooves between strands
    rise = 0.085 * np.clip(share / 0.16, 0, 1) ** 0.5 + 0.02 * np.sin(np.pi * share)
    rise = rise + 0.026 * ridge * np.clip(share / 0.1, 0, 1) * np.clip((1 - share) / 0.1, 0.3, 1)
    places = skin + rise[..., None] * ways - 0.015 * (1 - np.clip(share / 0.05, 0, 1))[..., None] * ways
    along = unit(np.gradient(places, axis=0).reshape(-1, 3))
    colours = _streaks(np.broadcast_to(ridge, rise.shape).ravel())
    triangles = grid_triangles(_ROWS, _COLUMNS, closed=True)[:, ::-1]
    return part("cap", places.reshape(-1, 3), triangles, colours, palette.HAIR_FINISH, along)


def _streaks(height: Real) -> Real:
    light = np.clip(0.5 + 0.5 * height, 0, 1)[:, None]
    deep, middle, bright = (np.array(c) for c in (palette.HAIR_DEEP, palette.HAIR, palette.HAIR_LIGHT))
    shaded, lit = deep + 2 * light * (middle - deep), middle + (2 * light - 1) * 0.55 * (bright - middle)
    return np.where(light < 0.5, shaded, lit)


def _bun() -> Part:
    down, around = np.meshgrid(np.linspace(0.02, np.pi - 0.02, 36), 2 * np.pi * np.arange(128) / 128, indexing="ij")
    twist = around + 1.5 * down
    height = np.cos(8 * twist + 1.4 * np.sin(2 * down))
    radius = 1 + 0.04 * height * np.sin(down)
    x, z = 0.40 * radius * np.sin(down) * np.cos(around), 0.38 * radius * np.sin(down) * np.sin(around)
    places = np.stack([x, 0.33 * radius * np.cos(down), z], axis=-1)
    strands = unit(np.stack([-np.sin(around), 0.6 * np.ones_like(around), np.cos(around)], axis=-1).reshape(-1, 3))
    triangles = grid_triangles(36, 128, closed=True)[:, ::-1]
    return part("bun", places.reshape(-1, 3) + BUN, triangles, _streaks(height.ravel()), palette.HAIR_FINISH, strands)


def _lock(points: Sequence[Sequence[float]], wide: float, thick: float, shade: float) -> Part:
    """Return a lock along places (x, y, z, and the distance from the skin below)."""
    knots = np.array(points)
    share = np.linspace(0, 1, 36)
    curve = CubicSpline(np.linspace(0, 1, len(knots)), knots)(share)
    ways = unit(curve[:, :3] - MIDDLE)
    path = seen_from_middle(head, ways) + curve[:, 3:] * ways
    taper = np.clip(1.15 * np.sin(np.pi * np.clip(0.12 + 0.87 * share, 0, 1)), 0.015, 1) ** 0.7
    places, triangles, strands = tube(path, wide * taper, thick * taper, ways, sides=16)
    across = np.tile(np.cos(2 * np.pi * np.arange(16) / 16), 36)
    colours = _streaks(shade + 0.35 * np.cos(9 * across))
    return part("lock", places, triangles, colours, palette.HAIR_FINISH, strands)
