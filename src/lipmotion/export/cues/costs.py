"""What every shape costs in every frame: what is said and how the lips move, weighed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lipmotion.export.cues.shapes import SHAPES, PhoneShapes, shapes_of_phone
from lipmotion.types import Generation, Motion, Span, Timeline, Unit
from lipmotion.units import LIP_CLOSING, SILENCE, VISEMES, is_silent

Array = NDArray[np.float64]
COST_RATE_HZ = 24.0
"""Costs are for a frame at this rate and scaled at others, so that the choice does not depend on the rate."""
ALLOWED, OTHER, MISPLACED = 0.5, 1.5, 3.0
"""A shape that passes for the sound; one that does not; one that belongs to other sounds only (``SPECIAL``)."""
SPECIAL = "AGHX"
OPENING_WEIGHT, SPREAD_WEIGHT = 6.0, 0.5
MUST_CLOSE, MUST_BITE = 10_000.0, 100.0
"""Of every p b m and f v one frame must show the shape. Where the hold leaves room for one only, p b m have it."""
WIDEST = 1.2
"""Wider still is still wide open."""
LEAST_OPENING = 1e-4
"""A mean opening under this, in the unit of the motion, is a mouth that stays shut: its rounding is not blown up."""
LIP_BITING = VISEMES["ld"]
LEAD_S = 0.02
"""The mouth is ready this long before the sound."""

_NAMES = "".join(SHAPES)
_POSES = np.array([(shape.opening, shape.spread) for shape in SHAPES.values()])


def frame_costs(generation: Generation, frames: int, fps: float) -> Array:
    """Return the cost of every one of ``SHAPES`` in every frame [shape=(frames, 9)].

    Frame k is shown from ``k / fps`` to ``(k + 1) / fps``; what is said or done in that time counts by its share.
    Where the motion has no channel ``opening`` or ``width``, the phones decide without it.
    """
    edges_s = np.arange(frames + 1) / fps
    facts = _phone_values_of_frames(generation.units, edges_s)
    cost, voiced, textbook = facts[:, : len(_NAMES)].copy(), facts[:, -3], facts[:, -2:]
    if "opening" in generation.motion.names:
        opening = _relative_opening(_means(generation.motion, "opening", edges_s), textbook[:, 0], voiced)
        cost += OPENING_WEIGHT * voiced[:, None] * (opening[:, None] - _POSES[:, 0]) ** 2
    if "width" in generation.motion.names:
        spread = _relative_spread(_means(generation.motion, "width", edges_s), textbook[:, 1], voiced)
        cost += SPREAD_WEIGHT * voiced[:, None] * (spread[:, None] - _POSES[:, 1]) ** 2
    cost *= COST_RATE_HZ / fps
    for frame, shape, price in _required_shapes(generation, frames, fps):
        cost[frame] += price
        cost[frame, _NAMES.index(shape)] -= price
    return cost


def _phone_values_of_frames(units: Timeline[Unit], edges_s: Array) -> Array:
    """Return what is known of each frame from what is said in it; where nothing is said, it is silent."""
    silence = _phone_values(shapes_of_phone(SILENCE)[0], silent=True)
    bounds_s, sums = [-LEAD_S], [np.zeros_like(silence)]
    for span in units:
        start_s = span.start_s - LEAD_S
        for look in shapes_of_phone(span.label.phone):
            duration_s = look.share * span.duration_s
            bounds_s += [start_s, start_s + duration_s]
            sums += [sums[-1], sums[-1] + duration_s * (_phone_values(look, is_silent(span.label.phone)) - silence)]
            start_s += duration_s
    return silence + _integrals(np.array(bounds_s), np.array(sums), edges_s)


def _phone_values(look: PhoneShapes, silent: bool) -> Array:
    """Return the cost of every shape, whether there is a voice, and opening and spread as in the textbook."""
    cost = [
        0.0 if name in look.best else ALLOWED if name in look.allowed else MISPLACED if name in SPECIAL else OTHER
        for name in _NAMES
    ]
    pose = _POSES[[_NAMES.index(name) for name in look.best]].mean(axis=0)
    return np.array([*cost, float(not silent), *pose])


def _means(motion: Motion, channel: str, edges_s: Array) -> Array:
    """Return the mean of a channel over each frame; beyond its ends it stays as it is."""
    grid_s = np.concatenate([motion.time_s, edges_s])
    grid_s.sort()
    values = np.interp(grid_s, motion.time_s, motion[channel])
    sums = np.concatenate([[0.0], np.cumsum(np.diff(grid_s) * (values[1:] + values[:-1]) / 2)])
    return _integrals(grid_s, sums[:, None], edges_s)[:, 0]


def _integrals(time_s: Array, sums: Array, edges_s: Array) -> Array:
    """Return means between edges from integrals up to some times [shape=(len(edges_s) − 1, columns)]."""
    at_edges = np.stack([np.interp(edges_s, time_s, column) for column in sums.T], axis=1)
    means: Array = np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None]
    return means


def _relative_opening(opening: Array, textbook: Array, voiced: Array) -> Array:
    """Return the opening in units of this mouth's own range: least squares onto what its phones are in the textbook.

    A scale without offset, for shut lips have none: so "boo" alone is not taken for a mouth wide open.
    """
    wanted = voiced * textbook
    least = LEAST_OPENING * max(float(wanted.sum()), 1.0)
    return np.clip(opening * (wanted @ wanted) / max(float(wanted @ opening), least), 0.0, WIDEST)


def _relative_spread(width: Array, textbook: Array, voiced: Array) -> Array:
    """Return the spread that the width speaks for: the regression of the textbook's on it, or else the mean."""
    total = max(float(voiced.sum()), 1e-9)
    mean = float(voiced @ textbook) / total
    centred = width - float(voiced @ width) / total
    weighted = voiced * centred
    slope = float(weighted @ (textbook - mean)) / max(float(weighted @ centred), 1e-9)
    return np.asarray(np.clip(mean + max(slope, 0.0) * centred, _POSES[:, 1].min(), _POSES[:, 1].max()))


def _required_shapes(generation: Generation, frames: int, fps: float) -> Iterator[tuple[int, str, float]]:
    """Yield the frame in which each p b m and f v must be seen, and in which shape."""
    for span in generation.units:
        if span.label.phone in LIP_CLOSING:
            yield min(int(_least_open_s(span, generation.motion) * fps), frames - 1), "A", MUST_CLOSE
        elif span.label.phone in LIP_BITING:
            yield min(int(_least_open_s(span, generation.motion) * fps), frames - 1), "G", MUST_BITE


def _least_open_s(span: Span[Unit], motion: Motion) -> float:
    """Return when in a phone the mouth is least open; its middle, where the motion does not tell."""
    first, last = np.ceil(span.start_s * motion.rate_hz - 1e-6), np.floor(span.end_s * motion.rate_hz + 1e-6)
    first, stop = int(max(first, 0)), int(min(last + 1, len(motion.values)))
    if "opening" not in motion.names or first >= stop:
        return max((span.start_s + span.end_s) / 2, 0.0)
    return float((first + int(motion["opening"][first:stop].argmin())) / motion.rate_hz + 1e-9)
