"""What goes into an engine and what comes out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.types.features import Features
from lipmotion.types.motion import Motion, between_frames
from lipmotion.types.timeline import Timeline, Unit


@dataclass(frozen=True, eq=False)
class Speech:
    """One recording as an engine sees it.

    units  : the phones in time
    said   : whether these are known (given, labelled, or aligned to known words), not recognised
    log_f0 : natural logarithm of F0 in Hz, NaN where there is no voice [shape=(T,)], for engines that hear it
    """

    features: Features
    units: Timeline[Unit]
    log_f0: NDArray[np.float32] | None = None
    units_known: bool = True


@dataclass(frozen=True, eq=False)
class Example:
    """Speech with the motion that went with it.

    motion : at 100 Hz, on the frames of ``speech.features``
    valid  : bool array [shape=(T,)], False where the motion was not seen
    """

    name: str
    speech: Speech
    motion: Motion
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class Pin:
    """The generated ``channel`` must take ``value`` at ``time_s`` (the nearest 10 ms frame)."""

    time_s: float
    channel: str
    value: float


@dataclass(frozen=True)
class Constraints:
    """What the generated motion must obey exactly."""

    pins: tuple[Pin, ...] = ()


@dataclass(frozen=True, eq=False)
class StateTrace:
    """Which state of the model stood behind each frame.

    states : readable names
    frames : int array [shape=(T,)], the index into ``states`` for every frame
    """

    states: tuple[str, ...]
    frames: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ReducedVariance:
    """Variances of P channels that follow from those of fewer dimensions: a long recording's are large.

    reduced : float array [shape=(T, Q)]
    mixing  : float array [shape=(Q, P)]
    """

    reduced: NDArray[np.floating[Any]]
    mixing: NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Generation:
    """The result of an engine.

    motion : the trajectory at 100 Hz
    spread : the model's own posterior variance, in squared channel units: float array [shape=(T, P)], or what it
             follows from
    units  : the labels behind it; edit them and generate again
    trace  : the states behind every frame
    """

    motion: Motion
    spread: NDArray[np.floating[Any]] | ReducedVariance
    units: Timeline[Unit]
    trace: StateTrace

    @property
    def variance(self) -> NDArray[np.floating[Any]]:
        """The variance of every channel in every frame [shape=(T, P)]; of a long recording, it is computed anew."""
        return self.variance_of(slice(None))

    def variance_of(self, frames: slice) -> NDArray[np.floating[Any]]:
        """Return the variance of every channel in some frames."""
        if isinstance(self.spread, ReducedVariance):
            return self.spread.reduced[frames] @ self.spread.mixing
        return self.spread[frames]

    def selected(self, names: Sequence[str]) -> Generation:
        """Return the result with these channels only, in this order. Raises InputError: no such channel."""
        columns = [self.motion.column(name) for name in names]
        channels = tuple(self.motion.channels[column] for column in columns)
        motion = Motion(self.motion.values[:, columns], self.motion.rate_hz, channels)
        if isinstance(self.spread, ReducedVariance):
            return replace(self, motion=motion, spread=replace(self.spread, mixing=self.spread.mixing[:, columns]))
        return replace(self, motion=motion, spread=self.spread[:, columns])

    def resampled(self, rate_hz: float) -> Generation:
        """Return the same result at another rate: values between frames, the state of the nearest frame.

        Raises InputError: the rate is not more than 0.
        """
        motion = self.motion.resampled(rate_hz)
        spread = self._spread_at(motion.time_s)
        nearest = np.minimum(np.round(motion.time_s * self.motion.rate_hz).astype(int), len(self.trace.frames) - 1)
        return replace(
            self, motion=motion, spread=spread, trace=StateTrace(self.trace.states, self.trace.frames[nearest])
        )

    def _spread_at(self, time_s: NDArray[np.float64]) -> NDArray[np.floating[Any]] | ReducedVariance:
        if isinstance(self.spread, ReducedVariance):
            reduced = between_frames(self.spread.reduced, self.motion.rate_hz, time_s)
            return replace(self.spread, reduced=reduced)
        return between_frames(self.spread, self.motion.rate_hz, time_s)
