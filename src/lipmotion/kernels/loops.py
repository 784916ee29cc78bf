"""Two loops of units beside each other that have nothing in common but what they emit: a factorial hidden Markov model.

States of a loop are numbered state-major: index = state · U + unit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Logs = NDArray[np.floating[Any]]


class Loop(NamedTuple):
    """U units in any order, each of n states from left to right without skips; probabilities.

    stay    : [shape=(n, U)]
    onward  : [shape=(n - 1, U)], to the next state
    leave   : [shape=(U,)], from the last state
    enter   : [shape=(U, U)], of the unit that follows (column) the one that is left (row)
    initial : [shape=(n, U)], of beginning there
    final   : [shape=(n, U)], of ending there (all ones: anywhere)
    """

    stay: Array
    onward: Array
    leave: Array
    enter: Array
    initial: Array
    final: Array


class LoopCounts(NamedTuple):
    """How often a loop is expected to do what; shapes as in ``Loop``.

    enter   : [shape=(U, U)], each unit behind each; the sum of a row is how often that unit is left
    initial : [shape=(n, U)], the posteriors of the first frame
    """

    stay: Array
    onward: Array
    enter: Array
    initial: Array


class FactorialLogLikelihoods(NamedTuple):
    """Log densities of one recording, finite or -inf; all as precise.

    audio, visual : [shape=(T, Na)] and [shape=(T, Nv)]; that of a joint state is their sum,
    pair          : [shape=(T, P)], but for some joint states, which have their own
    pairs         : [shape=(P, 2)], the audio and visual states of these, each pair once
    """

    audio: Logs
    visual: Logs
    pair: Logs
    pairs: Index

    @classmethod
    def of(cls, audio: Logs, visual: Logs) -> FactorialLogLikelihoods:
        """Return that without pairs."""
        return cls(audio, visual, np.empty((len(audio), 0), audio.dtype), np.empty((0, 2), np.intp))

    def densities(self, start: int, stop: int) -> list[FrameDensity]:
        """Return the densities of some frames."""
        logs = self.audio[start:stop], self.visual[start:stop], self.pair[start:stop]
        tops = [log.max(axis=1, initial=-np.inf).astype(np.float64) for log in logs]
        top_audio, top_visual = (np.where(np.isfinite(top), top, 0) for top in tops[:2])
        best = np.maximum(top_audio + top_visual, tops[2])
        audio, visual, pair = (
            np.exp(log - top[:, None]) for log, top in zip(logs, (top_audio, best - top_audio, best), strict=True)
        )
        one, other = self.pairs.T
        return [
            FrameDensity(audio[t], visual[t], pair[t], one, other, float(best[t]), (logs[0][t], logs[1][t], logs[2][t]))
            for t in range(stop - start)
        ]


class FrameDensity(NamedTuple):
    """Densities of a frame relative to the best that is possible.

    audio, visual : [shapes=(Na,), (Nv,)], whose products are those of joint states, but for pairs
    pair          : [shape=(P,)], those of pairs
    pair_audio, pair_visual : [shape=(P,)], the states of pairs
    best          : the logarithm of the best
    logs          : audio, visual and pair, as given
    """

    audio: Array
    visual: Array
    pair: Array
    pair_audio: Index
    pair_visual: Index
    best: float
    logs: tuple[Logs, Logs, Logs]


class LoopTransitions(NamedTuple):
    """The probabilities of a loop, ready to be applied.

    stay    : [shape=(N,)]
    onward  : [shape=(N - U,)], from state i to i + U
    leaving : [shape=(U, U)], from each unit's last state to each unit's first
    """

    stay: NDArray[Any]
    onward: NDArray[Any]
    leaving: NDArray[Any]

    @classmethod
    def of(cls, loop: Loop, kind: np.dtype[Any]) -> LoopTransitions:
        """Return those of a loop, in a precision."""
        leaving = loop.leave[:, None] * loop.enter
        return cls(*(np.ascontiguousarray(part, kind) for part in (loop.stay.ravel(), loop.onward.ravel(), leaving)))

    def forward(self, joint: NDArray[Any]) -> NDArray[Any]:
        """Return probabilities one frame on, along axis 0 [shape=(N, M)]."""
        units = len(self.leaving)
        after = joint * self.stay[:, None]
        after[units:] += joint[:-units] * self.onward[:, None]
        after[:units] += self.leaving.T @ joint[-units:]
        return after

    def backward(self, joint: NDArray[Any]) -> NDArray[Any]:
        """Return backward probabilities one frame back, along axis 0 [shape=(N, M)]."""
        units = len(self.leaving)
        before = joint * self.stay[:, None]
        before[:-units] += joint[units:] * self.onward[:, None]
        before[-units:] += self.leaving @ joint[:units]
        return before
