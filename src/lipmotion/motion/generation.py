"""From means and precisions to the motion of all channels, for all engines: scaling, pins, closures, limits."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.kernels.banded import generate
from lipmotion.motion.closure import OPENING, Closure, closing_frames, closing_spans
from lipmotion.motion.limits import MotionLimits
from lipmotion.motion.space import MotionSpace
from lipmotion.motion.variance_scaling import VarianceScaling
from lipmotion.types import (
    FRAME_RATE_HZ,
    WEIGHT,
    Constraints,
    Motion,
    ReducedVariance,
    Timeline,
    Unit,
    check_magnitude,
    frame_of,
)

STRETCH, MARGIN = 6000, 500
"""Frames generated at a time, and those around them that are generated again and thrown away: what lies seconds off
changes nothing, and the memory does not grow with the recording."""
DOUBLE_FRAMES = 60_000
"""The motion of recordings beyond ten minutes is kept in single precision, its variance in the model's space."""

Pins = dict[tuple[int, int], float]
"""Frame and column in the model's space, to the value there."""
Statistics = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Means and precisions of successive frames [each shape=(T, 3, Q)], or values and variances [each shape=(T, Q)]."""


@dataclass(frozen=True, eq=False)
class LearnedMotion:
    """What every engine learns of motion beside its statistics: the end of the path from speech to motion.

    space   : the Q dimensions in which motion is modelled
    closure : how the lips close (None: the motion has no channel ``opening``)
    limits  : of plausible motion
    scaling : variance scaling about the rest pose (None: movements stay as they are)
    """

    space: MotionSpace
    closure: Closure | None
    limits: MotionLimits
    scaling: VarianceScaling | None = None

    def generate(
        self,
        statistics: Callable[[slice], Statistics],
        frames: int,
        units: Timeline[Unit],
        constraints: Constraints | None = None,
        *,
        close: bool = True,
        closing_units: Container[str] = (),
    ) -> tuple[Motion, NDArray[np.floating[Any]] | ReducedVariance]:
        """Return the motion of all channels, and its variance [shape=(T, P)], by parameter generation.

        In this order: variance scaling, pins, parameter generation, closures in p, b and m, limits, all channels.
        statistics    : returns means and precisions of a range of frames [each shape=(N, 3, Q)]
        frames        : T, of the whole recording
        units         : phones in time
        close         : whether the lips are made to meet in every p, b and m
        closing_units : units without a phone that close the lips as well
        Raises InputError: a pin names no channel, lies outside the recording or is not finite.
        Raises ModelFormatError: the motion leaves the limits, so that the model must be damaged.
        """
        pins = resolved_pins(constraints, self.space, frames)
        closing = closing_spans(units, frames, closing_units) if close else []
        values, variance = self._generated(statistics, frames, closing, pins)
        return Motion(values, FRAME_RATE_HZ, self.space.channels), variance

    def _generated(
        self, statistics: Callable[[slice], Statistics], frames: int, closing: Sequence[slice], pins: Pins
    ) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]] | ReducedVariance]:
        """Return values and variance of all channels [each shape=(T, P)], block by block.

        closing : the frames of each phone in which the lips must close
        """
        space = self.space
        is_long = frames > DOUBLE_FRAMES
        precise = np.float32 if is_long else np.float64
        motion = np.empty((frames, len(space.channels)), precise)
        spread = np.empty((frames, space.dimensions if is_long else len(space.channels)), precise)
        for inner, outer in generation_blocks(frames):
            inside = {
                (frame - outer.start, c): v for (frame, c), v in pins.items() if outer.start <= frame < outer.stop
            }
            spans = [
                slice(span.start - outer.start, span.stop - outer.start)
                for span in closing
                if outer.start <= span.start and span.stop <= outer.stop
            ]
            predicted = statistics(outer)
            if self.scaling is not None:
                predicted = self.scaling.apply(*predicted)
            result = _generated(self.closure, predicted, inside, spans)
            self.limits.check(result[0], self.closure, inside)
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
