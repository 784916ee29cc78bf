"""Factorial hidden Markov models: two loops of units with independent transitions, and joint densities.

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
    """The probabilities of a loop of U units in any order, each of n states from left to right without skips.

    stay    : [shape=(n, U)], of staying in each state
    onward  : [shape=(n - 1, U)], of going to the next state
    leave   : [shape=(U,)], of leaving the last state
    enter   : [shape=(U, U)], of each next unit (column) after the unit that is left (row)
    initial : [shape=(n, U)], of beginning in each state
    final   : [shape=(n, U)], of ending in each state (all ones: anywhere)
    """

    stay: Array
    onward: Array
    leave: Array
    enter: Array
    initial: Array
    final: Array


class LoopCounts(NamedTuple):
    """Expected counts of the transitions of a loop; shapes as in ``Loop``.

    enter   : [shape=(U, U)], of each unit after each; the sum of a row is the count of that unit being left
    initial : [shape=(n, U)], posteriors of the first frame
    """

    stay: Array
    onward: Array
    enter: Array
    initial: Array


class FactorialLogLikelihoods(NamedTuple):
    """Log densities of one recording, finite or -inf, all of one precision.

    audio, visual : [shapes=(T, Na), (T, Nv)], whose sums are the log densities of joint states, except for pairs
    pair          : [shape=(T, P)], the log densities of pairs, joint states that have densities of their own
    pairs         : [shape=(P, 2)], the audio and visual state of each pair, each pair once
    """

    audio: Logs
    visual: Logs
    pair: Logs
    pairs: Index

    @classmethod
    def of(cls, audio: Logs, visual: Logs) -> FactorialLogLikelihoods:
        """Return the log densities of loops without pairs."""
        return cls(audio, visual, np.empty((len(audio), 0), audio.dtype), np.empty((0, 2), np.intp))

    def joint(self, t: int) -> Array:
        """Return the log densities of all joint states in a frame [shape=(Na, Nv)]."""
        joint = np.add.outer(self.audio[t], self.visual[t], dtype=np.float64)
        joint[tuple(self.pairs.T)] = self.pair[t]
        return joint

    def densities(self, start: int, stop: int) -> list[FrameDensity]:
        """Return the densities of the frames from ``start`` up to ``stop``."""
        logs = self.audio[start:stop], self.visual[start:stop], self.pair[start:stop]
        tops = [log.max(axis=1, initial=-np.inf).astype(np.float64) for log in logs]
        top_audio, top_visual = (np.where(np.isfinite(top), top, 0) for top in tops[:2])
        best = np.maximum(top_audio + top_visual, tops[2])
        audio, visual, pair = (
            np.exp(log - top[:, None]) for log, top in zip(logs, (top_audio, best - top_audio, best), strict=True)
        )
        pair_audio, pair_visual = self.pairs.T
        return [
            FrameDensity(
                audio[t],
                visual[t],
                pair[t],
                pair_audio,
                pair_visual,
                float(best[t]),
                (logs[0][t], logs[1][t], logs[2][t]),
            )
            for t in range(stop - start)
        ]


class FrameDensity(NamedTuple):
    """Densities of a frame, relative to an upper bound.

    audio, visual : [shapes=(Na,), (Nv,)], whose products are the densities of joint states, except for pairs
    pair          : [shape=(P,)], the densities of pairs
    pair_audio, pair_visual : [shape=(P,)], the states of pairs
    best          : the logarithm of the bound
    logs          : the log densities of audio, visual and pairs
    """

    audio: Array
    visual: Array
    pair: Array
    pair_audio: Index
    pair_visual: Index
    best: float
    logs: tuple[Logs, Logs, Logs]


class LoopTransitions(NamedTuple):
    """The transition probabilities of a loop, in the form that the steps apply.

    stay    : [shape=(N,)]
    onward  : [shape=(N - U,)], from state i to i + U
    leaving : [shape=(U, U)], from each unit's last state to each unit's first
    """

    stay: NDArray[Any]
    onward: NDArray[Any]
    leaving: NDArray[Any]

    @classmethod
    def of(cls, loop: Loop, kind: np.dtype[Any]) -> LoopTransitions:
        """Return the transitions of a loop, in the precision ``kind``."""
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
