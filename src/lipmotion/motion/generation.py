"""From means and precisions to the motion of all channels: stretch by stretch, through pins, lips closed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.kernels.banded import generate
from lipmotion.motion.closure import OPENING, Closure, closing_frames
from lipmotion.motion.limits import MotionLimits
from lipmotion.motion.space import MotionSpace
from lipmotion.types import FRAME_RATE_HZ, WEIGHT, Constraints, ReducedVariance, check_magnitude, frame_of

STRETCH, MARGIN = 6000, 500
"""Frames generated at a time, and those around them that are generated again and thrown away: what lies seconds off
changes nothing, and the memory does not grow with the recording."""
DOUBLE_FRAMES = 60_000
"""The motion of recordings beyond ten minutes is kept in single precision, its variance in the model's space."""

Pins = dict[tuple[int, int], float]
"""Frame and column in the model's space, to the value there."""
Statistics = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Means and precisions of successive frames [each shape=(T, 3, Q)], or values and variances [each shape=(T, Q)]."""


def generated_motion(
    statistics: Callable[[slice], Statistics],
    frames: int,
    space: MotionSpace,
    reach: MotionLimits,
    *,
    closure: Closure | None,
    closing: Sequence[slice],
    pins: Pins,
) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]] | ReducedVariance]:
    """Return the motion of all channels [shape=(T, P)] and its variance, by parameter generation.

    statistics : gives means and precisions of some frames
    reach      : between which values the model's poses lie
    closure    : how the lips close (None: the motion has no opening);  closing : the frames in which they must
    pins       : from ``resolved_pins``
    Raises ModelFormatError: the motion leaves all that the model's poses, and the pins, span.
    """
    is_long = frames > DOUBLE_FRAMES
    precise = np.float32 if is_long else np.float64
    motion = np.empty((frames, len(space.channels)), precise)
    spread = np.empty((frames, space.dimensions if is_long else len(space.channels)), precise)
    for inner, outer in generation_blocks(frames):
        inside = {(frame - outer.start, c): v for (frame, c), v in pins.items() if outer.start <= frame < outer.stop}
        spans = [
            slice(span.start - outer.start, span.stop - outer.start)
            for span in closing
            if outer.start <= span.start and span.stop <= outer.stop
        ]
        result = _generated(closure, statistics(outer), inside, spans)
        reach.check(result[0], closure, inside)
        kept = slice(inner.start - outer.start, inner.stop - outer.start)
        values, variance = (rows[kept] for rows in result)
        motion[inner], restored = space.restore(values, variance)
        spread[inner] = variance if is_long else restored
    weights = [channel.unit == WEIGHT for channel in space.channels]
    motion[:, weights] = np.maximum(motion[:, weights], 0)
    return motion, ReducedVariance(spread, space.mixing.astype(precise)) if is_long else spread


def resolved_pins(constraints: Constraints | None, space: MotionSpace, frames: int) -> Pins:
    """Return what is pinned, by frame and dimension. Raises InputError: it cannot be."""
    names = space.direct_names
    pins: Pins = {}
    for wanted in constraints.pins if constraints else ():
        if wanted.channel not in names:
            raise InputError(f"cannot pin {wanted.channel!r}; channels that can be pinned: {', '.join(names)}")
        frame = frame_of(wanted.time_s, frames, FRAME_RATE_HZ)
        if frame is None:
            last_s = (frames - 1) / FRAME_RATE_HZ
            raise InputError(f"pin at {wanted.time_s} s lies outside the recording (0 to {last_s:.2f} s)")
        if not np.isfinite(wanted.value):
            raise InputError(f"pin at {wanted.time_s} s has the value {wanted.value}, required a finite number")
        column = names.index(wanted.channel)
        check_magnitude(space.channels[space.direct[column]], wanted.value, wanted.value)
        never_negative = wanted.channel == OPENING or space.channels[space.direct[column]].unit == WEIGHT
        if never_negative and wanted.value < 0:
            raise InputError(f"pin at {wanted.time_s} s sets {wanted.channel} to {wanted.value}, required at least 0")
        pins[frame, column] = wanted.value
    return pins


def generation_blocks(frames: int) -> Iterator[tuple[slice, slice]]:
    """Give the frames of each stretch, and those with what lies around it; a shorter recording is one stretch."""
    for start in range(0, frames, STRETCH):
        stop = min(start + STRETCH, frames)
        yield slice(start, stop), slice(max(start - MARGIN, 0), min(stop + MARGIN, frames))


def _generated(closure: Closure | None, statistics: Statistics, pins: Pins, closing: Sequence[slice]) -> Statistics:
    """Return trajectory and variance in the model's space [shape=(T, Q)], lips closed where they must."""
    result = generate(*statistics, pins)
    if closure is not None:
        _close_lips(closure, closing, statistics, pins, result)
        opening = result[0][:, closure.column]
        np.maximum(opening, 0, out=opening)  # a smooth curve through a closure may overshoot
    return result


def _close_lips(
    closure: Closure,
    spans: Sequence[slice],
    statistics: Statistics,
    pins: Pins,
    result: Statistics,
) -> None:
    """Make the lips meet in every p, b and m (in place); what the user did not pin follows the opening."""
    values, variance = result
    column = closure.column
    taken = [frame for frame, pinned in pins if pinned == column]
    frames = closing_frames(closure, values[:, column], spans, taken)
    if not frames:
        return
    wanted = {(frame, 0): closure.closed for frame in frames}
    wanted |= {(frame, 0): pins[frame, column] for frame in taken}
    opening = slice(column, column + 1)
    closing, spread = generate(statistics[0][:, :, opening], statistics[1][:, :, opening], wanted)
    follow = closure.follow.copy()
    follow[[pinned for _, pinned in pins]] = 0
    values += (closing - values[:, opening]) * follow
    values[:, opening], variance[:, opening] = closing, spread
