"""Generation of motion from predicted means and precisions: scaling, pins, closures, filter, limits, all channels."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion import articulation
from lipmotion.motion.closure import Closure, choose_closed_frames, find_closable_ranges, fit_closure, is_never_negative
from lipmotion.motion.modulation_filter import ModulationFilter
from lipmotion.motion.space import MotionLimits, MotionSpace, fit_reduced_motion, measure_limits
from lipmotion.types import (
    FRAME_RATE_HZ,
    WEIGHT,
    Constraints,
    Example,
    Motion,
    Pin,
    ReducedVariance,
    Timeline,
    Unit,
    check_magnitude,
    frame_of,
)

Array = NDArray[np.float64]
LARGEST_FACTOR = 2.0  # no factor is larger: a dimension that hardly depends on speech would be scaled too far
MIN_DEVIATION = 1e-6


def fit_scaling_factors(recorded: Sequence[NDArray[Any]], generated: Sequence[Array]) -> Array:
    """Return the factors by which generated movements are scaled to vary as much as recorded ones [shape=(Q,)].

    recorded, generated : motion of each clip [each shape=(T_i, Q)]; at least one clip
    A factor is the mean over clips of the recorded standard deviations divided by that of the generated ones, from 1 to
    ``LARGEST_FACTOR``.
    """
    wanted, made = (np.mean([clip.std(axis=0) for clip in clips], axis=0) for clips in (recorded, generated))
    return np.clip(wanted / np.maximum(made, MIN_DEVIATION), 1.0, LARGEST_FACTOR)


class VarianceScaling(NamedTuple):
    """Factors by which movements away from the rest pose are scaled, dimension by dimension.

    Source: Silén, Helander, Nurminen & Gabbouj 2012. Deviation: scaling is about the rest pose, not about the mean, so
    that a closed mouth stays closed.
    """

    factors: Array  # from ``fit_scaling_factors`` [shape=(Q,)]
    rest: Array  # the rest pose [shape=(Q,)]

    def apply(self, means: Array, precisions: Array) -> tuple[Array, Array]:
        """Return means and precisions of static value, Δ and Δ² of the scaled movements [each shape=(T, 3, Q)]."""
        scaled = means * self.factors
        scaled[:, 0] += self.rest * (1 - self.factors)
        return scaled, precisions / (self.factors * self.factors)


BLOCK_FRAMES, MARGIN_FRAMES = 6000, 500
"""Frames of a block, and frames before and after it that are generated with it and then dropped: frames that are
seconds away do not change the result, and the memory does not grow with the recording."""
DOUBLE_FRAMES = 60_000  # the motion of recordings beyond ten minutes is in single precision

Pins = dict[tuple[int, int], float]  # pinned values by frame and dimension of the motion space


@dataclass(frozen=True, eq=False)
class LearnedMotion:
    """The parts of a model that turn predicted means and precisions into motion; the same for all engines."""

    space: MotionSpace  # the Q dimensions in which motion is modelled
    closure: Closure | None  # of the lips in p, b and m (None: the motion has no channel ``opening``)
    limits: MotionLimits  # of plausible motion in this space
    scaling: VarianceScaling | None = None  # about the rest pose (None: movements are not scaled)
    prior: articulation.ArticulationPrior | None = None  # for contexts that training saw little of (None: as generated)
    modulation: ModulationFilter | None = None  # restores fast movement after generation (None: it stays as it is)

    def for_voice(self, voice: float) -> LearnedMotion:
        """Return the same with a modulation filter that is weaker, the less training knows the voice.

        voice : how well training knows it, 0 to 1; without a filter, or at 1, nothing changes
        Where much of the motion is wrong, fast movement makes it worse (docs/results/jerk.md).
        """
        if self.modulation is None or voice == 1:
            return self
        return replace(self, modulation=self.modulation.scale_to(1 - articulation.count_unseen(voice)))

    def generate(  # noqa: PLR0913
        self,
        statistics: articulation.Predict,
        frames: int,
        units: Timeline[Unit],
        constraints: Constraints | None = None,
        *,
        close: bool = True,
        closing_units: Container[str] = (),
        reliability: NDArray[np.float64] | float = 1.0,
        voice: float = 1.0,
        articulators: NDArray[np.float64] | None = None,
        range_db: NDArray[np.float64] | float = 0.0,
    ) -> tuple[Motion, ReducedVariance]:
        """Return the motion of all channels at 100 Hz, and its variance, by parameter generation.

        The steps are blending with the table of articulation, variance scaling, parameter generation with pins,
        closures in p, b and m, the modulation filter, the check of the limits, and the restoration of all channels.
        Voices that training does not know part their lips to speak, have typical talkers' range, and follow what the
        general network hears; it confirms closures, those of known voices too (``motion.articulation``).
        statistics    : returns the predicted means and precisions of a range of frames [each shape=(N, 3, Q)]
        frames, units : length of the whole recording, T, and its phones in time
        constraints   : pins of channels that are modelled as they are
        close         : whether the lips are made to meet in every p, b and m
        closing_units : units that close the lips where no phone is known
        reliability   : of the phones in time, 0 to 1 [shape=(T,)]
        voice         : how well training knows the voice, 0 to 1: others move as far as people do on average
        articulators  : what the general network hears [shape=(T, 8)], but of known voices whose words are given
        range_db      : decibels between loud and quiet moments, 0 in digital silence [shape=(T,)]
        Raises InputError: a pin names no channel, lies outside the recording, is not finite, or contradicts another.
        Raises ModelFormatError: the motion leaves the limits, so that the model must be damaged.
        """
        pins = resolve_pins(constraints, self.space, frames)
        scaling, ranges = self.scaling, find_closable_ranges(units, frames, closing_units)
        if self.prior is not None:
            statistics = self.prior.blend(statistics, units, frames, reliability, voice)
            if (voice < 1 or articulators is not None) and scaling is not None and self.closure is not None:
                speaker = articulation.UnseenSpeaker(self.prior, units, frames, reliability, voice, range_db)
                statistics = speaker.raise_contrast(statistics)
                statistics = speaker.open_before_speech(statistics)
                ranges = find_closable_ranges(units, frames, closing_units, articulation.choose_closing_reach(voice))
                if articulators is not None:
                    statistics = speaker.follow_sound(statistics, articulators)
                    ranges = speaker.confirm_closures(ranges, articulators)
                if "width" in self.space.direct_names:
                    statistics = speaker.slow_width(statistics, self.space.direct_names.index("width"))
                gain = articulation.widen_range(self.prior, self.space, voice, float(np.mean(reliability)))
                scaling = scaling._replace(factors=scaling.factors * gain)
        ranges = ranges if close else []
        space, precision = self.space, np.float32 if frames > DOUBLE_FRAMES else np.float64
        motion = np.empty((frames, len(space.channels)), precision)
        spread = np.empty((frames, space.dimensions), precision)
        for inner, outer in split_into_blocks(frames):
            inner_pins = (((f, c), v) for (f, c), v in pins.items() if outer.start <= f < outer.stop)
            block_pins = {(f - outer.start, c): v for (f, c), v in inner_pins}
            block_ranges = [
                slice(closing.start - outer.start, closing.stop - outer.start)
                for closing in ranges
                if outer.start <= closing.start and closing.stop <= outer.stop
            ]
            predicted = statistics(outer) if scaling is None else scaling.apply(*statistics(outer))
            values, variance = self._solve_block(predicted, block_pins, block_ranges)
            self.limits.check(values, self.closure, block_pins)
            inside = slice(inner.start - outer.start, inner.stop - outer.start)
            motion[inner] = space.restore(values[inside])
            spread[inner] = variance[inside]
        weights = [channel.unit == WEIGHT for channel in space.channels]
        motion[:, weights] = np.maximum(motion[:, weights], 0)
        return Motion(motion, FRAME_RATE_HZ, space.channels), ReducedVariance(spread, space.mixing.astype(precision))

    def _solve_block(
        self, statistics: articulation.Statistics, pins: Pins, ranges: Sequence[slice]
    ) -> articulation.Statistics:
        """Return values and variances of a block [each shape=(T, Q)], with the lips closed once in every range.

        Where lips are to close, the opening is generated again with pins at the closed frames; the change of the
        opening is added to all dimensions that the user did not pin, in the proportions of ``closure.follow``.
        """
        values, variance = solve_mlpg(*statistics, pins)
        closed_frames: list[int] = []
        if self.closure is not None:
            column = self.closure.column
            pinned = [frame for frame, dimension in pins if dimension == column]
            frames = choose_closed_frames(self.closure, values[:, column], ranges, pinned)
            if frames:
                opening_pins = {(frame, 0): self.closure.closed for frame in frames}
                opening_pins |= {(frame, 0): pins[frame, column] for frame in pinned}
                opening = slice(column, column + 1)
                means, precisions = (rows[:, :, opening] for rows in statistics)
                closed, closed_variance = solve_mlpg(means, precisions, opening_pins)
                follow = self.closure.follow.copy()
                follow[[dimension for _, dimension in pins]] = 0
                values += (closed - values[:, opening]) * follow
                values[:, opening], variance[:, opening] = closed, closed_variance
            closed_frames = [r.start + int(values[r, column].argmin()) for r in ranges]
        if self.modulation is not None:
            values = self.modulation.apply(values, closed_frames, pins)
        if self.closure is not None:
            opened = values[:, self.closure.column]
            np.maximum(opened, 0, out=opened)  # a smooth curve through a closure may overshoot
        return values, variance


def bend_through_pins(values: NDArray[np.float64], pins: Sequence[tuple[int, int, float]], reach: int) -> None:
    """Bend curves [shape=(T, P)] through pins (frame, column, value), within ``reach`` frames; all hold exactly."""
    for frame, column, value in pins:
        if abs(lacking := value - values[frame, column]) > 1e-9:
            first, stop = max(frame - reach, 0), min(frame + reach + 1, len(values))
            distance = np.abs(np.arange(first, stop) - frame) / (reach + 1)
            values[first:stop, column] += lacking * (1 + np.cos(np.pi * distance)) / 2
    for frame, column, value in pins:
        values[frame, column] = value


def find_pinned_frame(pin: Pin, frames: int, rate_hz: float = FRAME_RATE_HZ, *, is_weight: bool = False) -> int:
    """Return the frame of a pin. Raises InputError: a time outside of the frames, or a value that is not possible."""
    if not np.isfinite(pin.value) or (is_weight and not 0 <= pin.value <= 1):
        required = "0 to 1" if is_weight else "a finite number"
        raise InputError(f"pin at {pin.time_s} s sets {pin.channel} to {pin.value}, required {required}")
    frame = frame_of(pin.time_s, frames, rate_hz)
    if frame is None:
        last_s = (frames - 1) / rate_hz
        raise InputError(f"pin at {pin.time_s} s lies outside the recording (0 to {last_s:.2f} s)")
    return frame


def resolve_pins(constraints: Constraints | None, space: MotionSpace, frames: int) -> Pins:
    """Return the pinned values by frame and dimension of the motion space; of two pins in one frame the last holds.

    frames : length of the recording
    Raises InputError: a channel that cannot be pinned, a time outside the recording, or a value that is not possible.
    """
    names = space.direct_names
    pins: Pins = {}
    for pin in constraints.pins if constraints else ():
        if pin.channel not in names:
            raise InputError(
                f"cannot pin {shorten(repr(pin.channel))}; channels that can be pinned: {', '.join(names)}"
            )
        frame = find_pinned_frame(pin, frames)
        column = names.index(pin.channel)
        check_magnitude(space.channels[space.direct[column]], pin.value, pin.value)
        if is_never_negative(space.channels[space.direct[column]]) and pin.value < 0:
            raise InputError(f"pin at {pin.time_s} s sets {pin.channel} to {pin.value}, required at least 0")
        pins[frame, column] = pin.value
    return pins


def split_into_blocks(frames: int) -> Iterator[tuple[slice, slice]]:
    """Yield the frames of every block, and the same with ``MARGIN_FRAMES`` on both sides, cut at the ends."""
    for start in range(0, frames, BLOCK_FRAMES):
        stop = min(start + BLOCK_FRAMES, frames)
        yield slice(start, stop), slice(max(start - MARGIN_FRAMES, 0), min(stop + MARGIN_FRAMES, frames))


def fit_motion(examples: Sequence[Example], components: int) -> tuple[LearnedMotion, list[NDArray[np.float64]]]:
    """Return the learned motion of some examples, and the motion of each in the motion space [each shape=(T, Q)].

    components : principal components that all point channels are reduced to
    The limits are the extremes of the valid frames; there is no variance scaling.
    Raises CorpusError: no example has valid motion, or the examples have different channels.
    """
    space, values = fit_reduced_motion(examples, components)
    closure = fit_closure(space.direct_names, values, examples)
    valid = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    prior = articulation.fit_articulation_prior(space, values, examples)
    return LearnedMotion(space, closure, measure_limits(valid), prior=prior), values
