"""Selection of cues: the sequence of held shapes with the least total cost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.export.cues.cue_shapes import PhoneShapes, shapes_of_phone
from lipmotion.export.cues.sheet import CueSheet, cue_frame_count, cue_sheet, drawn_shapes
from lipmotion.kernels.trellis import best_segments
from lipmotion.types import Generation, Motion, Span, Timeline, Unit
from lipmotion.units import SILENCE, VISEMES, closing_phones, is_silent, words_in_time
from lipmotion.units.mouth_chart import OPTIONAL, SHAPES, drawn_shape

Array = NDArray[np.float64]
COST_RATE_HZ = 24.0
"""Costs are for a frame at this rate and scaled at others, so that the choice does not depend on the rate."""
ALLOWED_COST, OTHER_COST, MISPLACED_COST = 0.5, 1.5, 3.0
"""Cost of a shape that is acceptable for the phone; of one that is not; of one of ``SPECIAL`` for another phone."""
SPECIAL = "AGHX"
OPENING_WEIGHT, SPREAD_WEIGHT = 6.0, 0.5
UNCLOSED_COST, UNBITTEN_COST = 10_000.0, 100.0
"""Cost where the one frame of a p b m, or f v, does not show its shape: where only one fits, p b m win."""
LARGEST_OPENING = 1.2
"""Largest relative opening that is distinguished."""
LEAST_OPENING = 1e-4
"""Least mean opening, in the unit of the motion, that scales: a mouth that stays closed is not amplified."""
LIP_BITING = VISEMES["ld"]
LEAD_S = 0.02
"""The shape of a phone begins this long before its sound."""

_NAMES = "".join(SHAPES)
_POSES = np.array([(shape.opening, shape.spread) for shape in SHAPES.values()])


def frame_costs(generation: Generation, frames: int, fps: float, intensity: float = 1.0) -> Array:
    """Return the cost of every one of ``SHAPES`` in every frame [shape=(frames, 9)].

    Frame k is shown from ``k / fps`` to ``(k + 1) / fps``; phones and motion count by their share of that time.
    Where the motion has no channel ``opening`` or ``width``, the phones alone decide.
    """
    edges_s = np.arange(frames + 1) / fps
    silence = _phone_values(shapes_of_phone(SILENCE)[0], silent=True)
    bounds_s, sums = [-LEAD_S], [np.zeros_like(silence)]
    for span in generation.units:
        start_s = span.start_s - LEAD_S
        for part in shapes_of_phone(span.label.phone):
            duration_s = part.share * span.duration_s
            bounds_s += [start_s, start_s + duration_s]
            sums += [sums[-1], sums[-1] + duration_s * (_phone_values(part, is_silent(span.label.phone)) - silence)]
            start_s += duration_s
    phone_values = silence + _integrals(np.array(bounds_s), np.array(sums), edges_s)
    cost, voiced, nominal = phone_values[:, : len(_NAMES)].copy(), phone_values[:, -3], phone_values[:, -2:]
    if "opening" in generation.motion.names:
        opening = _relative_opening(_means(generation.motion, "opening", edges_s), nominal[:, 0], voiced)
        opening = np.minimum(intensity * opening, LARGEST_OPENING)
        cost += OPENING_WEIGHT * voiced[:, None] * (opening[:, None] - _POSES[:, 0]) ** 2
    if "width" in generation.motion.names:
        spread = _relative_spread(_means(generation.motion, "width", edges_s), nominal[:, 1], voiced)
        spread = np.clip(intensity * spread, _POSES[:, 1].min(), _POSES[:, 1].max())
        cost += SPREAD_WEIGHT * voiced[:, None] * (spread[:, None] - _POSES[:, 1]) ** 2
    cost *= COST_RATE_HZ / fps
    for frame, shape, penalty in _required_shapes(generation, frames, fps):
        cost[frame] += penalty
        cost[frame, _NAMES.index(shape)] -= penalty
    return cost


def _phone_values(part: PhoneShapes, silent: bool) -> Array:
    """Return, for a part of a phone, the costs of all shapes, whether it is speech, nominal opening and spread.

    Result [shape=(12,)]; opening and spread are the means over the best shapes.
    """
    cost = [
        0.0
        if name in part.best
        else ALLOWED_COST
        if name in part.allowed
        else MISPLACED_COST
        if name in SPECIAL
        else OTHER_COST
        for name in _NAMES
    ]
    pose = _POSES[[_NAMES.index(name) for name in part.best]].mean(axis=0)
    return np.array([*cost, float(not silent), *pose])


def _means(motion: Motion, channel: str, edges_s: Array) -> Array:
    """Return the mean of a channel over each frame [shape=(frames,)]; beyond its ends it is constant."""
    grid_s = np.concatenate([motion.time_s, edges_s])
    grid_s.sort()
    values = np.interp(grid_s, motion.time_s, motion[channel])
    sums = np.concatenate([[0.0], np.cumsum(np.diff(grid_s) * (values[1:] + values[:-1]) / 2)])
    return _integrals(grid_s, sums[:, None], edges_s)[:, 0]


def _integrals(time_s: Array, sums: Array, edges_s: Array) -> Array:
    """Return means between edges [shape=(len(edges_s) − 1, columns)] from integrals up to the times ``time_s``."""
    at_edges = np.stack([np.interp(edges_s, time_s, column) for column in sums.T], axis=1)
    return np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None]


def _relative_opening(opening: Array, nominal: Array, voiced: Array) -> Array:
    """Return the opening scaled to the nominal openings of the phones by least squares [shape=(frames,)].

    There is no offset, because closed lips have opening 0; so "boo" alone does not count as a mouth wide open.
    """
    wanted = voiced * nominal
    least = LEAST_OPENING * max(float(wanted.sum()), 1.0)
    return np.clip(opening * (wanted @ wanted) / max(float(wanted @ opening), least), 0.0, LARGEST_OPENING)


def _relative_spread(width: Array, nominal: Array, voiced: Array) -> Array:
    """Return the spread predicted from the width [shape=(frames,)]: linear regression on the nominal spreads."""
    total = max(float(voiced.sum()), 1e-9)
    mean = float(voiced @ nominal) / total
    centred = width - float(voiced @ width) / total
    weighted = voiced * centred
    slope = float(weighted @ (nominal - mean)) / max(float(weighted @ centred), 1e-9)
    return np.asarray(np.clip(mean + max(slope, 0.0) * centred, _POSES[:, 1].min(), _POSES[:, 1].max()))


def _required_shapes(generation: Generation, frames: int, fps: float) -> Iterator[tuple[int, str, float]]:
    """Yield the frame in which each p b m and f v must be shown, its shape, and the cost of other shapes."""
    units = generation.units
    for span, closing in zip(units, closing_phones(units), strict=True):
        if closing:
            yield min(int(_least_open_s(span, generation.motion) * fps), frames - 1), "A", UNCLOSED_COST
        elif span.label.phone in LIP_BITING:
            yield min(int(_least_open_s(span, generation.motion) * fps), frames - 1), "G", UNBITTEN_COST


def _least_open_s(span: Span[Unit], motion: Motion) -> float:
    """Return the time in a phone at which the mouth is least open; without an opening, the middle of the phone."""
    first, last = np.ceil(span.start_s * motion.rate_hz - 1e-6), np.floor(span.end_s * motion.rate_hz + 1e-6)
    first, stop = int(max(first, 0)), int(min(last + 1, len(motion.values)))
    if "opening" not in motion.names or first >= stop:
        return max((span.start_s + span.end_s) / 2, 0.0)
    return float((first + int(motion["opening"][first:stop].argmin())) / motion.rate_hz + 1e-9)


CHANGE_COST = 0.35
"""Cost of a change of shape, in the unit of ``costs``."""
HOLD_S = 2 / 24


def default_hold_frames(fps: float) -> int:
    """Return the number of frames nearest to two frames at 24 fps, the shortest hold of a mouth in animation."""
    return max(1, int(HOLD_S * fps + 0.5))


def choose_cues(
    generation: Generation,
    fps: float = 24.0,
    hold_frames: int | None = None,
    optional: str = OPTIONAL,
    intensity: float = 1.0,
) -> CueSheet:
    """Return the cues of generated motion.

    fps         : frames per second of the animation, 1 to 100
    hold_frames : minimum length of a cue in frames, > 0; a shorter recording has one cue
    optional    : which of the shapes G, H and X the character has
    intensity   : openings and spread so many times as large, before shapes are chosen
    The result is exact: of all sequences that keep the hold, the one of least cost (``costs``, ``sequences.segments``).
    Cost: about 10 µs a frame.
    """
    motion, drawn = generation.motion, drawn_shapes(optional)
    duration_s = max(0.0, (len(motion.values) - 1) / motion.rate_hz, *(span.end_s for span in generation.units))
    frames = cue_frame_count(duration_s, fps)
    cost = np.empty((0, len(drawn)))
    if frames:
        cost = _costs_of_drawn_shapes(frame_costs(generation, frames, fps, intensity), drawn)
    segments = best_segments(cost, hold_frames or default_hold_frames(fps), CHANGE_COST)
    sheet = cue_sheet([(frame, drawn[label]) for frame, label in segments], duration_s, fps, drawn)
    return replace(sheet, words=Timeline(tuple(span for span in words_in_time(generation.units) if span.label)))


def _costs_of_drawn_shapes(cost: NDArray[np.float64], drawn: str) -> NDArray[np.float64]:
    """Return the cost of the drawn shapes [shape=(frames, drawn)]: the least cost of those that each one stands for."""
    names = list(SHAPES)
    groups = [[column for column, other in enumerate(names) if drawn_shape(other, drawn) == name] for name in drawn]
    return np.stack([cost[:, group].min(axis=1) for group in groups], axis=1)
