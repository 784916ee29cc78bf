"""Factorial hidden Markov models: two loops of units with independent transitions, joint densities, best paths.

States of a loop are numbered state-major: index = state · U + unit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Logs = NDArray[np.floating[Any]]
ROOM_BYTES = 2**27  # memory for what is stored of many frames at once: of as many as fit in, but of √T at least


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

    enter : [shape=(U, U)], of each unit after each; the sum of a row is the count of that unit being left
    """

    stay: Array
    onward: Array
    enter: Array


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
        bounds = zip(logs, (top_audio, best - top_audio, best), strict=True)
        audio, visual, pair = (np.exp(log - top[:, None]) for log, top in bounds)
        return [FrameDensity(*rows) for rows in zip(audio, visual, pair, best.tolist(), strict=True)]


class FrameDensity(NamedTuple):
    """Densities of a frame, relative to an upper bound.

    audio, visual : [shapes=(Na,), (Nv,)], whose products are the densities of joint states, except for pairs
    pair          : [shape=(P,)], the densities of pairs
    best          : the logarithm of the bound
    """

    audio: Array
    visual: Array
    pair: Array
    best: float


class LogTransitions(NamedTuple):
    """Log transition probabilities of a loop.

    stay    : [shape=(N,)]
    onward  : [shape=(N - U,)], from state i to i + U
    leaving : [shape=(U, U)], from each unit's last state to each unit's first
    """

    stay: Array
    onward: Array
    leaving: Array

    @classmethod
    def of(cls, loop: Loop) -> LogTransitions:
        """Return the transitions of a loop."""
        with np.errstate(divide="ignore"):
            leaving = np.log(loop.leave)[:, None] + np.log(loop.enter)
            return cls(np.log(loop.stay.ravel()), np.log(loop.onward.ravel()), leaving)

    def forward(self, joint: Array, wanted: NDArray[np.bool_]) -> Array:
        """Return log probabilities one frame on, along axis 0 [shape=(N, M)]; of states not ``wanted``: -inf."""
        return _move_logs(np.ascontiguousarray(joint), self.stay, self.onward, self.leaving, wanted)

    def reverse(self) -> LogTransitions:
        """Return the transitions of the loop backward in time, states in the opposite order."""
        parts = self.stay[::-1], self.onward[::-1], self.leaving.T[::-1, ::-1]
        return LogTransitions(*map(np.ascontiguousarray, parts))

    def best_forward(self, score: Array) -> tuple[Array, NDArray[Any]]:
        """Return the best scores a frame on, along axis 0, and decisions: U to stay, U + 1 to go on, or a unit left."""
        units = len(self.leaving)
        after = score + self.stay[:, None]
        decision = np.full(score.shape, units, np.min_scalar_type(units + 1))
        moved = score[: len(self.onward)] + self.onward[:, None]
        np.copyto(decision[units:], units + 1, where=moved > after[units:])
        np.maximum(after[units:], moved, out=after[units:])
        last, first = score[len(score) - units :], (after[:units], decision[:units])
        _take_best_entering(last, self.leaving, *first)
        return after, decision

    def previous(self, state: int, decision: int) -> int:
        """Return the state one frame before, given the decision."""
        units = len(self.leaving)
        if decision < units:
            return len(self.stay) - units + decision
        return state - units if decision > units else state


def count_cached_frames(frames: int, frame_bytes: int) -> int:
    """Return the number of frames that are stored at once, of ``frame_bytes`` each."""
    return max(math.isqrt(max(frames - 1, 0)) + 1, min(frames, ROOM_BYTES // frame_bytes))


def log_ends(audio: Loop, visual: Loop) -> tuple[Array, Array]:
    """Return the log probabilities of beginning and of ending in each joint state [shapes=(Na, Nv)]."""
    with np.errstate(divide="ignore"):
        parts = ((np.log(loop.initial.ravel()), np.log(loop.final.ravel())) for loop in (audio, visual))
        initial, final = (np.add.outer(*ends) for ends in zip(*parts, strict=True))
    return initial, final


def find_factorial_path(
    audio: Loop, visual: Loop, logs: FactorialLogLikelihoods, stretch: int | None = None
) -> tuple[Index, Index, float]:
    """Return the most probable states of both loops [shapes=(T,)], and the log probability of path and recording.

    stretch : frames whose decisions are stored at once; others are computed twice; None: as ``infer_factorial``
    Where there is no path: states 0, and -inf.  Of equally probable paths, any one.
    Source: the Viterbi recursion, along one loop's axis and then along the other's.
    Cost: time O(T·Na·Nv·(Ua + Uv)), memory O(stretch + T/stretch) times Na·Nv.
    """
    frames = len(logs.audio)
    stretch = stretch or count_cached_frames(frames, 2 * logs.audio.shape[1] * logs.visual.shape[1])
    loops = LogTransitions.of(audio), LogTransitions.of(visual)

    def search(start: int, stop: int, score: Array) -> tuple[Array, list[tuple[NDArray[Any], NDArray[Any]]]]:
        """Return the scores after the frames of a stretch, and for each the decisions [shapes=(Na, Nv), (Nv, Na)]."""
        decisions = list[tuple[NDArray[Any], NDArray[Any]]]()
        for t in range(start, stop):
            score, by_audio = loops[0].best_forward(score)
            turned, by_visual = loops[1].best_forward(np.ascontiguousarray(score.T))
            score = turned.T + logs.joint(t)
            decisions.append((by_audio, by_visual))
        return score, decisions

    initial, final = log_ends(audio, visual)
    score = initial + logs.joint(0)
    befores, decisions = [], list[tuple[NDArray[Any], NDArray[Any]]]()
    for start in range(1, frames, stretch):
        befores.append((start, score))
        score, decisions = search(start, min(start + stretch, frames), score)
    path = np.zeros((frames, 2), np.intp)
    score = score + final
    best = float(score.max())
    if best == -np.inf:
        return path[:, 0], path[:, 1], best
    path[-1] = np.unravel_index(int(score.argmax()), score.shape)
    for start, before in reversed(befores):
        if start != befores[-1][0]:
            _, decisions = search(start, min(start + stretch, frames), before)
        for t in range(start + len(decisions) - 1, start - 1, -1):
            by_audio, by_visual = decisions[t - start]
            state, other = path[t]
            other = loops[1].previous(other, int(by_visual[other, state]))  # the later decision
            path[t - 1] = loops[0].previous(state, int(by_audio[state, other])), other
    return path[:, 0], path[:, 1], best


@compiled
def _take_best_entering(last: Array, leaving: Array, score: Array, decision: Array) -> None:
    """Replace scores and decisions of first states [shapes=(U, M)] where leaving a last state [(U, M)] is better."""
    for i in range(len(score)):
        best, unit = score[i], decision[i]
        for u in range(len(last)):
            before, weight = last[u], leaving[u, i]
            for j in range(len(best)):
                other = before[j] + weight
                is_better = other > best[j]
                best[j] = other if is_better else best[j]
                unit[j] = u if is_better else unit[j]


@compiled
def _move_logs(before: Array, stay: Array, onward: Array, leaving: Array, wanted: NDArray[np.bool_]) -> Array:
    """Return log probabilities one frame on, along axis 0; what cannot be takes no time."""
    after = np.full(before.shape, -np.inf)
    units = len(leaving)
    last = before[len(before) - units :]
    for i in range(len(before)):
        row = after[i]
        for j in range(len(row) if wanted[i] else 0):
            row[j] = before[i, j] + stay[i]
            best = row[j]
            if i >= units:
                moved = before[i - units, j] + onward[i - units]
                best = max(best, moved)
                if best > -np.inf:
                    row[j] = best + math.log(math.exp(row[j] - best) + math.exp(moved - best))
                continue
            for u in range(units):
                best = max(best, last[u, j] + leaving[u, i])
            if best > -np.inf:
                total = math.exp(row[j] - best)
                for u in range(units):
                    total += math.exp(last[u, j] + leaving[u, i] - best)
                row[j] = best + math.log(total)
    return after
