"""Posteriors and expected counts of factorial hidden Markov models (``kernels.loops``), by forward–backward.

Each loop moves along its own axis of the joint states, so a frame costs Na·Nv·(Ua + Uv) and not (Na·Nv)², and the
joint transitions are never written down.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels import factorial_steps
from lipmotion.kernels.choice import numba_works
from lipmotion.kernels.loops import Array, FactorialLogLikelihoods, FrameDensity, Loop, LoopCounts, LoopTransitions

ROOM_BYTES = 2**27
"""Forward probabilities of as many frames as fit are kept at once, if they are not many more than √T."""
LEAST_OVERLAP = 1e-20
"""In single precision: where forward and backward probabilities (sums 1) meet less, both may lack what matters."""


class FactorialPosteriors(NamedTuple):
    """What a recording says about two loops.

    audio, visual : [shapes=(T, Na), (T, Nv)], the probability of every state of each loop in every frame
    pair          : [shape=(T, P)], of the joint states with densities of their own
    audio_counts, visual_counts : over the recording
    log_likelihood : -inf where there is no path, and then everything else is 0
    """

    audio: Array
    visual: Array
    pair: Array
    audio_counts: LoopCounts
    visual_counts: LoopCounts
    log_likelihood: float


def factorial_posteriors(
    audio: Loop, visual: Loop, evidence: FactorialLogLikelihoods, stretch: int | None = None
) -> FactorialPosteriors:
    """Return what a recording says about two loops.

    stretch : frames whose forward probabilities are kept at once, while those of the others are computed twice;
        None: √T, or as many as ``ROOM_BYTES`` hold
    Exact up to paths that were 320 nats under a frame's best.  Evidence in single precision is worked on in single
    precision if it can be (compiled, and nothing that matters is left out), which takes half the time.
    Source: Ghahramani & Jordan (1997), "Factorial hidden Markov models", appendix B.
    Cost: time O(T·Na·Nv·(Ua + Uv)), memory O(stretch + T/stretch) times Na·Nv.
    """
    order = np.lexsort(evidence.pairs.T[::-1])
    evidence = evidence._replace(pair=evidence.pair[:, order], pairs=evidence.pairs[order])
    found = None
    if evidence.audio.dtype == np.float32 and numba_works():
        found = _Recording.of(audio, visual, evidence, stretch, np.dtype(np.float32)).posteriors(LEAST_OVERLAP)
    found = found or _Recording.of(audio, visual, evidence, stretch, np.dtype(np.float64)).posteriors(0)
    found = found or _nothing(audio, visual, evidence)
    return found._replace(pair=found.pair[:, np.argsort(order)])


def kept_frames(frames: int, frame_bytes: int) -> int:
    """Return how many frames' forward probabilities are kept at once."""
    return max(math.isqrt(max(frames - 1, 0)) + 1, min(frames, ROOM_BYTES // frame_bytes))


class _Recording(NamedTuple):
    """One recording in one precision; ``room``, ``leaving`` and ``densities`` are of one stretch."""

    loops: tuple[Loop, Loop]
    moves: tuple[LoopTransitions, LoopTransitions]
    evidence: FactorialLogLikelihoods
    stretch: int
    room: NDArray[Any]
    leaving: NDArray[Any]
    densities: list[FrameDensity]
    steps: Any

    @classmethod
    def of(
        cls, audio: Loop, visual: Loop, evidence: FactorialLogLikelihoods, stretch: int | None, kind: np.dtype[Any]
    ) -> _Recording:
        states = audio.stay.size, visual.stay.size
        stretch = stretch or kept_frames(len(evidence.audio), states[0] * states[1] * kind.itemsize)
        room = np.empty((stretch, *states), kind)
        leaving = np.empty((stretch, states[0], len(visual.leave)), kind)
        moves = LoopTransitions.of(audio, kind), LoopTransitions.of(visual, kind)
        steps: Any = factorial_steps
        if numba_works():
            from lipmotion.kernels import factorial_fused as steps
        return cls((audio, visual), moves, evidence, stretch, room, leaving, [], steps)

    def posteriors(self, least_overlap: float) -> FactorialPosteriors | None:
        """Return what the recording says; None if there seems to be no path, or not enough is sure."""
        starts = range(0, len(self.evidence.audio), self.stretch)
        befores: list[NDArray[Any]] = []
        log_likelihood, last = 0.0, self.room[:0]
        for start in starts:
            befores.append(last)
            log_likelihood += self._forward(start, last)
            if log_likelihood == -np.inf:
                return None
            last = self.room[self._stop(start) - start - 1].copy()
        final = np.multiply.outer(*(loop.final.ravel() for loop in self.loops)).astype(last.dtype)
        found = _Found.of(self.loops, self.evidence)
        closed = factorial_steps.frame_posteriors(last, final, self.densities[-1])
        if not found.take(len(self.evidence.audio) - 1, closed, 0):
            return None
        backward, _ = factorial_steps.times_density(final, self.densities[-1])
        for start, before in zip(reversed(starts), reversed(befores), strict=True):
            if start != starts[-1]:
                self._forward(start, before)
            for t in range(self._stop(start) - 1, max(start, 1) - 1, -1):
                forward, density = self.room[t - 1 - start], self.densities[t - 1 - start]
                if t == start:
                    forward, density = before, self.evidence.densities(t - 1, t)[0]
                step = self.steps.retreat(forward, backward, self.leaving[t - start], *self.moves, density)
                if not found.take(t - 1, step.closed, least_overlap):
                    return None
                found.audio_entered[:] += step.audio_entered
                found.visual_entered[:] += step.visual_entered
                backward = step.backward
        return found.result(self.loops, float(log_likelihood) + math.log(closed.overlap))

    def _stop(self, start: int) -> int:
        return min(start + self.stretch, len(self.evidence.audio))

    def _forward(self, start: int, before: NDArray[Any]) -> float:
        """Fill in the forward probabilities of a stretch; return the log of what they are divided by."""
        log_total = 0.0
        self.densities[:] = self.evidence.densities(start, self._stop(start))
        for t, density in enumerate(self.densities, start):
            if t == 0:
                initial = np.multiply.outer(*(loop.initial.ravel() for loop in self.loops)).astype(self.room.dtype)
                self.room[0], log = factorial_steps.times_density(initial, density)
            else:
                self.room[t - start], self.leaving[t - start], log = self.steps.advance(before, *self.moves, density)
            before, log_total = self.room[t - start], log_total + log
            if log == -np.inf:
                break
        return log_total


class _Found(NamedTuple):
    """Posteriors and sums over frames, as they come."""

    audio: Array
    visual: Array
    pair: Array
    audio_entered: Array
    visual_entered: Array

    @classmethod
    def of(cls, loops: tuple[Loop, Loop], evidence: FactorialLogLikelihoods) -> _Found:
        shapes = [log.shape for log in (evidence.audio, evidence.visual, evidence.pair)]
        return cls(*(np.zeros(shape) for shape in (*shapes, *(loop.enter.shape for loop in loops))))

    def take(self, t: int, closed: factorial_steps.FramePosteriors, least_overlap: float) -> bool:
        """Take the posteriors of a frame; return whether they are sure."""
        self.audio[t], self.visual[t], self.pair[t] = closed.audio, closed.visual, closed.pair
        return closed.overlap > least_overlap

    def result(self, loops: tuple[Loop, Loop], log_likelihood: float) -> FactorialPosteriors:
        counts = (
            _counted(loops[0], self.audio, self.audio_entered),
            _counted(loops[1], self.visual, self.visual_entered),
        )
        return FactorialPosteriors(self.audio, self.visual, self.pair, *counts, log_likelihood)


def _counted(loop: Loop, posterior: Array, entered: Array) -> LoopCounts:
    """Return expected counts: what enters a state and does not stay there goes on."""
    enter = entered * (loop.leave[:, None] * loop.enter)
    frames = posterior.reshape(-1, *loop.stay.shape)
    gained = frames[-1] - frames[0]
    behind = np.cumsum(gained[::-1], axis=0)[::-1] - gained
    out = np.maximum(enter.sum(axis=1) + behind, 0)
    stay = np.maximum(frames[:-1].sum(axis=0) - out, 0)
    return LoopCounts(stay, out[:-1], enter, frames[0])


def _nothing(audio: Loop, visual: Loop, evidence: FactorialLogLikelihoods) -> FactorialPosteriors:
    counts = [
        LoopCounts(*(np.zeros_like(part) for part in (loop.stay, loop.onward, loop.enter, loop.initial)))
        for loop in (audio, visual)
    ]
    in_audio, in_visual, in_pairs = (np.zeros(log.shape) for log in (evidence.audio, evidence.visual, evidence.pair))
    return FactorialPosteriors(in_audio, in_visual, in_pairs, counts[0], counts[1], -np.inf)
