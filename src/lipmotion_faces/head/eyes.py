"""Eyeballs, lashes and brows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.head import palette
from lipmotion_faces.head.forms import EYE, EYEBALL_RADIUS, head, seen_from_front
from lipmotion_faces.head.part import Part, grid_triangles, joined_parts, part, tube
from lipmotion_faces.head.pose import CharacterPose

Real = NDArray[np.float64]

IRIS, PUPIL = 0.115, 0.055
"""Radii of iris and pupil, as lengths on the eyeball."""
CATCHLIGHT = 2.2
"""Reflections of lamps are brighter than white paint."""
_SIDES = 48
LASHES = 33
"""Columns of the lashes: those of the upper lid."""


def eyeball() -> Part:
    """Return the left eyeball, its middle at (0, 0, 0), looking along +z."""
    radii = np.array(
        [
            0,
            0.022,
            PUPIL - 0.004,
            PUPIL,
            0.068,
            0.083,
            0.098,
            IRIS - 0.006,
            IRIS,
            IRIS + 0.006,
            0.138,
            0.162,
            0.19,
            0.215,
        ]
    )
    angle = np.arcsin(np.clip(radii / EYEBALL_RADIUS, 0, 0.999))
    angle = np.concatenate([angle, np.linspace(angle[-1] + 0.15, 2.0, 5)])
    around = 2 * np.pi * np.arange(_SIDES) / _SIDES
    dome = EYEBALL_RADIUS + 0.007 * np.maximum(1 - (np.concatenate([radii, np.full(5, 1.0)]) / 0.125) ** 2, 0)
    ring = np.stack(
        [
            np.sin(angle)[:, None] * np.cos(around),
            np.sin(angle)[:, None] * np.sin(around),
            np.cos(angle)[:, None] * np.ones(_SIDES),
        ],
        axis=-1,
    )
    places = (dome[:, None, None] * ring).reshape(-1, 3)
    colours = np.zeros((len(angle), _SIDES, 3))
    ray = 0.5 + 0.25 * np.sin(7 * around) * np.sin(19 * around + 1) + 0.25 * np.sin(31 * around)
    lower = 0.5 - 0.5 * np.sin(around)
    for n in range(len(angle)):
        radius = radii[n] if n < len(radii) else 1.0
        if radius <= PUPIL - 0.004:
            colours[n] = palette.PUPIL
        elif radius <= IRIS - 0.006:
            depth = (radius - PUPIL) / (IRIS - PUPIL)
            light = np.clip(0.25 + 0.55 * lower + 0.25 * ray - 0.5 * (depth - 0.45) ** 2, 0, 1)[:, None]
            colours[n] = (1 - light) * np.array(palette.IRIS_DARK) + light * np.array(palette.IRIS_LIGHT)
            if depth > 0.7:
                colours[n] = 0.55 * colours[n] + 0.45 * np.array(palette.IRIS_RIM)
        elif radius <= IRIS:
            colours[n] = palette.IRIS_RIM
        else:
            colours[n] = palette.EYE_WHITE
    return part(
        "eye", places, grid_triangles(len(angle), _SIDES, closed=True), colours.reshape(-1, 3), palette.EYE_FINISH
    )


def catchlights() -> Part:
    """Return the reflections of lamp and window in the left eye, its middle at (0, 0, 0)."""
    discs = []
    for (x, y), radius, white in (((-0.045, 0.05), 0.026, 1.0), ((0.038, -0.045), 0.012, 0.8)):
        around = 2 * np.pi * np.arange(16) / 16
        flat = np.concatenate([[[x, y]], np.stack([x + radius * np.cos(around), y + radius * np.sin(around)], axis=1)])
        away = EYEBALL_RADIUS + 0.010
        z = np.sqrt(away**2 - (flat**2).sum(axis=1))
        fan = np.stack([np.zeros(16, int), 1 + np.arange(16), 1 + (np.arange(16) + 1) % 16], axis=1).astype(np.int32)
        discs.append(part("light", np.column_stack([flat, z]), fan, (white, white, white), palette.GLOWING))
    lights = joined_parts("catchlights", discs)
    return replace(lights, colours=CATCHLIGHT * lights.colours)


def lash_triangles() -> NDArray[np.int32]:
    """Return the triangles of the lashes, two rows of ``LASHES`` vertices, seen from both sides [shape=(F, 3)]."""
    front = grid_triangles(3, LASHES)
    return np.concatenate([front, front[:, ::-1]])


def lashes(edge: Real, shut: float) -> Real:
    """Return the places of the left eye's lashes, a dark wedge along the upper lid [shape=(3 * LASHES, 3)].

    edge : of the upper lid from the inner corner to the outer one [shape=(LASHES, 3)]
    """
    share = np.linspace(0, 1, LASHES)
    thick = 0.004 + 0.018 * np.sin(np.pi * (0.12 + 0.8 * share)) ** 0.7 * share**0.4
    length = 0.012 + 0.045 * share**1.5
    length = length * np.clip((1 - share) / 0.03 + 0.35, 0, 1)
    out = edge - EYE
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    sweep = np.stack([0.75 * share, (0.75 - 1.2 * shut) * np.ones(LASHES), 0.55 + 0 * share], axis=1)
    sweep /= np.linalg.norm(sweep, axis=1, keepdims=True)
    upper = edge + 0.004 * out + thick[:, None] * np.array([0.0, 0.62, 0.1])
    tip = upper + length[:, None] * sweep
    below = edge + 0.006 * out + np.array([0, -0.004, 0.0])
    return np.concatenate([tip, 0.5 * (upper + edge) + 0.012 * out, below])


def brow() -> Part:
    """Return the left brow."""
    share = np.linspace(0, 1, 30)
    x = 0.135 + 0.40 * share
    y = 0.279 + 0.006 * share + 0.026 * np.sin(np.pi * share**1.3)
    z = seen_from_front(head, x, y)
    path = np.stack([x, y, z + 0.004], axis=1)
    wide = 0.033 * np.clip(1.02 - share, 0.01, 1) ** 0.6 * np.clip(share / 0.4, 0.02, 1) ** 0.6
    upward = np.broadcast_to([0.25, 0.1, 1.0], path.shape)
    places, triangles, strands = tube(path, wide, 0.45 * wide + 0.006, upward, sides=12)
    return part("brow", places, triangles, palette.BROW, palette.BROW_FINISH, strands)


INNER_RISE, OUTER_RISE, LOWERED, TOGETHER = 0.12, 0.1, (0.1, 0.03), 0.055
"""How far a mood raises the inner and the outer ends of the brows, lowers the inner ends, and outer ones, and draws
them together."""


def brow_shift(places: Real, pose: CharacterPose) -> Real:
    """Return how a mood moves places of a brow at rest [shape=(N, 3)]."""
    outwards = np.clip((np.abs(places[:, 0]) - 0.135) / 0.4, 0, 1)
    inner = (1 - outwards) ** 1.5
    moved, mood = np.zeros_like(places), pose.mood
    moved[:, 1] = INNER_RISE * mood.inner * inner + OUTER_RISE * mood.outer * np.sin(0.72 * np.pi * outwards**1.3)
    moved[:, 1] -= mood.lowered * (LOWERED[0] * inner + LOWERED[1] * (1 - inner))
    moved[:, 0] = -TOGETHER * mood.lowered * np.sign(places[:, 0]) * (1 - outwards)
    return moved
