"""Posteriors and expected counts of factorial hidden Markov models (``kernels.sequences.loops``), by forward–backward.

Each loop has transitions along its own axis of the joint states only, so a frame costs Na·Nv·(Ua + Uv) and not
(Na·Nv)², and the matrix of joint transitions is never computed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import numba_works
from lipmotion.kernels.sequences import factorial_steps
from lipmotion.kernels.sequences.loops import (
    Array,
    FactorialLogLikelihoods,
    FrameDensity,
    Loop,
    LoopCounts,
    LoopTransitions,
)

ROOM_BYTES = 2**27
"""Memory for the forward probabilities that are stored at once: of as many frames as fit in, but of √T at least."""
OFF: dict[np.dtype[Any], float] = {np.dtype(np.float32): 1e-4, np.dtype(np.float64): 1e-10}
"""By precision: the largest share of the likelihood that may come of probabilities that were raised."""
LEAST_POSTERIOR = 1e-20
"""Smaller posteriors and counts are set to 0, as those of states that cannot be are not quite 0."""
LEAST_PROBABILITY = 1e-100
"""Least probability of a transition, or of beginning or ending in a state: products of smaller ones may underflow."""


class FactorialPosteriors(NamedTuple):
    """Posteriors and expected counts of a recording in two loops.

    audio, visual : [shapes=(T, Na), (T, Nv)], posteriors of the states of each loop
    pair          : [shape=(T, P)], posteriors of the joint states with densities of their own
    audio_counts, visual_counts : expected counts of the transitions of each loop
    log_likelihood : -inf where there is no path: then everything else is 0
    Posteriors and counts under 1e-20 are 0.

    Guaranteed but for rounding, however improbable a path is at first: the likelihood is right to a share of δ, and the
    errors of the posteriors of a frame, or of the counts of a step from frame to frame, sum to 3 δ at most: δ is 1e-4
    for log densities in single precision, 1e-10 for those in double precision (``OFF``).
    """

    audio: Array
    visual: Array
    pair: Array
    audio_counts: LoopCounts
    visual_counts: LoopCounts
    log_likelihood: float


def factorial_posteriors(
    audio: Loop, visual: Loop, logs: FactorialLogLikelihoods, stretch: int | None = None
) -> FactorialPosteriors:
    """Return the posteriors and expected counts of a recording in two loops.

    logs    : log densities of the recording
    stretch : frames whose forward probabilities are stored at once; those of the others are computed twice;
        None: √T, or as many as ``ROOM_BYTES`` hold
    Log densities in single precision are processed in single precision where that is possible (compiled, and without
    loss), which takes half the time. Where double precision may lose paths that count, because they were some 250 nats
    below a frame's best, the recording is processed in logarithms (``factorial_logs``).
    Source: Ghahramani & Jordan (1997), "Factorial hidden Markov models", appendix B. Forward and backward probabilities
    are raised to a least one, never set to 0, and so are upper bounds; how much may come of that follows from the
    overlap of both in each frame.
    Cost: time O(T·Na·Nv·(Ua + Uv)), memory O(stretch + T/stretch) times Na·Nv.
    """
    order = np.lexsort(logs.pairs.T[::-1])
    logs = logs._replace(pair=logs.pair[:, order], pairs=logs.pairs[order])
    result = None
    if min(_least_probability(loop) for loop in (audio, visual)) >= LEAST_PROBABILITY:
        for kind in OFF:
            if result is None and (kind == np.float64 or (logs.audio.dtype == kind and numba_works())):
                result = _ForwardBackward.of(audio, visual, logs, stretch, kind).posteriors()
    result = result or _posteriors_in_logs(audio, visual, logs) or _zero_posteriors(audio, visual, logs)
    return result._replace(pair=result.pair[:, np.argsort(order)])


def kept_frames(frames: int, frame_bytes: int) -> int:
    """Return the number of frames whose forward probabilities are stored at once, of ``frame_bytes`` each."""
    return max(math.isqrt(max(frames - 1, 0)) + 1, min(frames, ROOM_BYTES // frame_bytes))


class _ForwardBackward(NamedTuple):
    """Forward–backward of one recording in one precision; ``room``, ``leaving`` and ``densities`` are of one stretch.

    room    : forward probabilities [shape=(stretch, Na, Nv)]
    leaving : probabilities of leaving the last visual states, as of ``factorial_steps.forward_step``
    steps   : the module with the steps, ``factorial_steps`` or ``factorial_fused``
    """

    loops: tuple[Loop, Loop]
    moves: tuple[LoopTransitions, LoopTransitions]
    logs: FactorialLogLikelihoods
    stretch: int
    room: NDArray[Any]
    leaving: NDArray[Any]
    densities: list[FrameDensity]
    steps: Any

    @classmethod
    def of(
        cls, audio: Loop, visual: Loop, logs: FactorialLogLikelihoods, stretch: int | None, kind: np.dtype[Any]
    ) -> _ForwardBackward:
        states = audio.stay.size, visual.stay.size
        stretch = stretch or kept_frames(len(logs.audio), states[0] * states[1] * kind.itemsize)
        room = np.empty((stretch, *states), kind)
        leaving = np.empty((stretch, states[0], len(visual.leave)), kind)
        moves = LoopTransitions.of(audio, kind), LoopTransitions.of(visual, kind)
        steps: Any = factorial_steps
        if numba_works():
            from lipmotion.kernels.sequences import factorial_fused as steps
        return cls((audio, visual), moves, logs, stretch, room, leaving, [], steps)

    def posteriors(self) -> FactorialPosteriors | None:
        """Return the posteriors; None: there is no path, or the precision is not enough."""
        starts = range(0, len(self.logs.audio), self.stretch)
        kind, least_overlap = self.room.dtype, self._least_overlap
        befores: list[NDArray[Any]] = []
        log_likelihood, last = 0.0, self.room[:0]
        for start in starts:
            befores.append(last)
            log_likelihood += self._forward(start, last)
            if log_likelihood == -np.inf:
                return None
            last = self.room[self._stop(start) - start - 1].copy()
        final = self._ends("final")
        totals = _Accumulator.of(self.loops, self.logs)
        last_frame = factorial_steps.frame_posteriors(last, final, self.densities[-1])
        if not totals.store(len(self.logs.audio) - 1, last_frame, least_overlap):
            return None
        backward, _ = factorial_steps.times_density(final, self.densities[-1], kind)
        for start, before in zip(reversed(starts), reversed(befores), strict=True):
            if start != starts[-1]:
                self._forward(start, before)
            for t in range(self._stop(start) - 1, max(start, 1) - 1, -1):
                forward, density = self.room[t - 1 - start], self.densities[t - 1 - start]
                if t == start:
                    forward, density = before, self.logs.densities(t - 1, t)[0]
                step = self.steps.backward_step(forward, backward, self.leaving[t - start], *self.moves, density)
                if not totals.store(t - 1, step.frame, least_overlap):
                    return None
                totals.audio_entered[:] += step.audio_entered
                totals.visual_entered[:] += step.visual_entered
                backward = step.backward
        return totals.result(self.loops, float(log_likelihood) + math.log(last_frame.overlap))

    @property
    def _least_overlap(self) -> float:
        """The least overlap of forward and backward probabilities, both of sum 1, with which what was raised makes no
        more than ``OFF`` of the likelihood over all frames. In a frame that is 1 / whole² at most for each joint state,
        forward and backward, times the sum of all that leads to a state or from it: up to U + 2 ≤ 3 U in each loop.
        """
        kind, states = self.room.dtype, self.room[0].size
        return 2 * len(self.logs.audio) * 9 * states / factorial_steps.WHOLE[kind] ** 2 / OFF[kind]

    def _ends(self, name: str) -> Array:
        """Return the probabilities of beginning (``initial``) or ending (``final``) in joint states, of the whole."""
        product = np.multiply.outer(*(getattr(loop, name).ravel() for loop in self.loops))
        return np.asarray(product * factorial_steps.WHOLE[self.room.dtype])

    def _stop(self, start: int) -> int:
        return min(start + self.stretch, len(self.logs.audio))

    def _forward(self, start: int, before: NDArray[Any]) -> float:
        """Fill in the forward probabilities of a stretch; return the log of the product of their scales."""
        log_total = 0.0
        self.densities[:] = self.logs.densities(start, self._stop(start))
        for t, density in enumerate(self.densities, start):
            if t == 0:
                self.room[0], log = factorial_steps.times_density(self._ends("initial"), density, self.room.dtype)
            else:
                self.room[t - start], self.leaving[t - start], log = self.steps.forward_step(
                    before, *self.moves, density
                )
            before, log_total = self.room[t - start], log_total + log
            if log == -np.inf:
                break
        return log_total


class _Accumulator(NamedTuple):
    """Posteriors of all frames, and sums over frames; filled in place."""

    audio: Array
    visual: Array
    pair: Array
    audio_entered: Array
    visual_entered: Array

    @classmethod
    def of(cls, loops: tuple[Loop, Loop], logs: FactorialLogLikelihoods) -> _Accumulator:
        shapes = [log.shape for log in (logs.audio, logs.visual, logs.pair)]
        return cls(*(np.zeros(shape) for shape in (*shapes, *(loop.enter.shape for loop in loops))))

    def store(self, t: int, frame: factorial_steps.FramePosteriors, least_overlap: float) -> bool:
        """Store the posteriors of a frame; return whether their overlap is more than ``least_overlap``."""
        self.audio[t], self.visual[t], self.pair[t] = frame.audio, frame.visual, frame.pair
        return frame.overlap > least_overlap

    def result(self, loops: tuple[Loop, Loop], log_likelihood: float) -> FactorialPosteriors:
        counts = (
            _counted(loops[0], self.audio, self.audio_entered),
            _counted(loops[1], self.visual, self.visual_entered),
        )
        for part in (self.audio, self.visual, self.pair, *counts[0], *counts[1]):
            part[part < LEAST_POSTERIOR] = 0
        return FactorialPosteriors(self.audio, self.visual, self.pair, *counts, log_likelihood)


def _posteriors_in_logs(audio: Loop, visual: Loop, logs: FactorialLogLikelihoods) -> FactorialPosteriors | None:
    """Return the posteriors, computed in logarithms; None: there is no path."""
    from lipmotion.kernels.sequences.factorial_logs import LogForwardBackward

    steps, frames = LogForwardBackward.of(audio, visual, logs), len(logs.audio)
    with np.errstate(divide="ignore", invalid="ignore"):
        initial, final = (
            np.add.outer(*(np.log(getattr(loop, name).ravel()) for loop in (audio, visual)))
            for name in ("initial", "final")
        )
    stretch = kept_frames(frames, initial.nbytes)
    starts = range(0, frames, stretch)

    def forward_of(start: int, before: Array | None) -> list[Array]:
        """Return the log forward probabilities of a stretch."""
        found: list[Array] = []
        for t in range(start, min(start + stretch, frames)):
            before = initial + logs.joint(0) if before is None else steps.forward(before, t)
            found.append(before)
        return found

    befores: list[Array | None] = [None]
    for start in starts:
        stretch_forward = forward_of(start, befores[-1])
        befores.append(stretch_forward[-1])
    totals = _Accumulator.of((audio, visual), logs)
    last = steps.frame(stretch_forward[-1], final)
    if not math.isfinite(last.overlap):
        return None
    totals.store(frames - 1, last, -math.inf)
    backward = final + logs.joint(frames - 1)
    for start, before in zip(reversed(starts), reversed(befores[:-1]), strict=True):
        forward = forward_of(start, before)
        for t in range(start + len(forward) - 1, start - 1, -1):
            if t == frames - 1:
                continue
            step = steps.back(forward[t - start], backward, t)
            totals.store(t, step.frame, -math.inf)
            totals.audio_entered[:] += step.audio_entered
            totals.visual_entered[:] += step.visual_entered
            backward = step.backward
    return totals.result((audio, visual), last.overlap)


def _counted(loop: Loop, posterior: Array, entered: Array) -> LoopCounts:
    """Return expected counts, from posteriors and from how often each unit was entered after each.

    A state is left as often as it is entered, but for the first and last frame; it is kept in the other frames.
    """
    enter = entered * (loop.leave[:, None] * loop.enter)
    frames = posterior.reshape(-1, *loop.stay.shape)
    gained = frames[-1] - frames[0]
    after = np.cumsum(gained[::-1], axis=0)[::-1] - gained
    left = np.maximum(enter.sum(axis=1) + after, 0)
    stay = np.maximum(frames[:-1].sum(axis=0) - left, 0)
    return LoopCounts(stay, left[:-1], enter, frames[0])


def _least_probability(loop: Loop) -> float:
    """Return the least probability of a loop that is not 0."""
    parts = (loop.stay, loop.onward, loop.leave[:, None] * loop.enter, loop.initial, loop.final)
    return min(float(part.min(where=part > 0, initial=1.0)) for part in parts)


def _zero_posteriors(audio: Loop, visual: Loop, logs: FactorialLogLikelihoods) -> FactorialPosteriors:
    """Return the result for a recording without a path."""
    counts = [
        LoopCounts(*(np.zeros_like(part) for part in (loop.stay, loop.onward, loop.enter, loop.initial)))
        for loop in (audio, visual)
    ]
    in_audio, in_visual, in_pairs = (np.zeros(log.shape) for log in (logs.audio, logs.visual, logs.pair))
    return FactorialPosteriors(in_audio, in_visual, in_pairs, counts[0], counts[1], -np.inf)
