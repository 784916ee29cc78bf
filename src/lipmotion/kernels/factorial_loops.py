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

    def to_doubles(self) -> FactorialLogLikelihoods:
        """Return the same in double precision and C order, which the kernels of logarithms are compiled for alone."""
        audio, visual, pair = (np.ascontiguousarray(log, np.float64) for log in (self.audio, self.visual, self.pair))
        return FactorialLogLikelihoods(audio, visual, pair, self.pairs)

    def densities(self, start: int, stop: int) -> list[tuple[Logs, Logs, Logs, float]]:
        """Return, for each frame, densities relative to an upper bound, and its logarithm; those of pairs in full."""
        logs = self.audio[start:stop], self.visual[start:stop], self.pair[start:stop]
        tops = [log.max(axis=1, initial=-np.inf).astype(np.float64) for log in logs]
        top_audio, top_visual = (np.where(np.isfinite(top), top, 0) for top in tops[:2])
        best = np.maximum(top_audio + top_visual, tops[2])
        bounds = zip(logs, (top_audio, best - top_audio, best), strict=True)
        audio, visual, pair = (np.exp(log - top[:, None]) for log, top in bounds)
        return list(zip(audio, visual, pair, best.tolist(), strict=True))


@compiled
def join_logs(logs: FactorialLogLikelihoods, t: int) -> Array:
    """Return the log densities of all joint states in a frame [shape=(Na, Nv)]."""
    joint = logs.audio[t].astype(np.float64)[:, None] + logs.visual[t]
    for p in range(len(logs.pairs)):
        joint[logs.pairs[p, 0], logs.pairs[p, 1]] = logs.pair[t, p]
    return joint


class LogTransitions(NamedTuple):
    """Transitions of a loop.

    stay    : log probabilities [shape=(N,)]
    onward  : log probabilities of going from state i to i + U [shape=(N - U,)]
    leaving : log probabilities of going from each unit's last state to each unit's first [shape=(U, U)]
    shares  : probabilities of the same [shape=(U, U)]
    """

    stay: Array
    onward: Array
    leaving: Array
    shares: Array

    @classmethod
    def of(cls, loop: Loop) -> LogTransitions:
        """Return the transitions of a loop."""
        with np.errstate(divide="ignore"):
            leaving = np.log(loop.leave)[:, None] + np.log(loop.enter)
            return cls(np.log(loop.stay.ravel()), np.log(loop.onward.ravel()), leaving, np.exp(leaving))

    def reverse(self) -> LogTransitions:
        """Return the transitions of the loop backward in time, states in the opposite order."""
        parts = self.stay[::-1], self.onward[::-1], self.leaving.T[::-1, ::-1], self.shares.T[::-1, ::-1]
        return LogTransitions(*map(np.ascontiguousarray, parts))


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
    frames, logs, loops = len(logs.audio), logs.to_doubles(), (LogTransitions.of(audio), LogTransitions.of(visual))
    initial, final = log_ends(audio, visual)
    stretch = stretch or count_cached_frames(frames, initial.nbytes)
    path, heads = np.zeros((frames, 2), np.intp), [initial + join_logs(logs, 0)]
    scores = heads[0][None]
    for start in range(1, frames, stretch):
        scores = _fill_scores(heads[-1], *loops, logs, start, min(start + stretch, frames))
        heads.append(scores[-1].copy())
    ends = scores[-1] + final
    best = float(ends.max())
    if best == -np.inf:
        return path[:, 0], path[:, 1], best
    path[-1] = np.unravel_index(int(ends.argmax()), ends.shape)
    starts = range(1, frames, stretch)
    for start, head in zip(reversed(starts), reversed(heads[:-1]), strict=True):
        if start != starts[-1]:
            scores = _fill_scores(head, *loops, logs, start, start + stretch)
        _trace_back(head, scores, *loops, path, start)
    return path[:, 0], path[:, 1], best


@compiled
def _fill_scores(
    before: Array, audio: LogTransitions, visual: LogTransitions, logs: FactorialLogLikelihoods, start: int, stop: int
) -> Array:
    """Return the best scores after the frames from ``start`` to ``stop`` [shape=(stop - start, Na, Nv)]."""
    scores, row = np.empty((stop - start, *before.shape)), np.empty(before.shape[1])
    units, others, stay, onward = len(audio.leaving), len(visual.leaving), visual.stay, visual.onward
    last, inner = before.shape[0] - units, before.shape[1] - others
    for t in range(start, stop):
        after = scores[t - start]
        for i in range(len(before)):
            own, source = audio.stay[i], before[i]
            for j in range(len(row)):
                row[j] = source[j] + own
            if i < units:
                _take_best(before[last:], audio.leaving[:, i], row)
            else:
                _take_best(before[i - units : i - units + 1], audio.onward[i - units : i - units + 1], row)
            into = after[i]
            for j in range(len(row)):
                into[j] = row[j] + stay[j]
            _take_best(visual.leaving, row[inner:], into[:others])
            further = into[others:]
            for j in range(inner):
                further[j] = max(further[j], row[j] + onward[j])
        after += join_logs(logs, t)
        before = after
    return scores


@compiled
def _take_best(scores: Array, weights: Array, best: Array) -> None:
    """Raise the best scores [shape=(M,)] to those of ways [shape=(U, M)] and their weights, four at a time."""
    blocks_end = len(scores) // 4 * 4
    for u in range(0, blocks_end, 4):
        a, b, c, d = scores[u], scores[u + 1], scores[u + 2], scores[u + 3]
        w, x, y, z = weights[u], weights[u + 1], weights[u + 2], weights[u + 3]
        for j in range(len(best)):
            one, other = max(a[j] + w, b[j] + x), max(c[j] + y, d[j] + z)
            best[j] = max(best[j], max(one, other))  # noqa: PLW3301 # faster than one call
    for u in range(blocks_end, len(scores)):
        a, w = scores[u], weights[u]
        for j in range(len(best)):
            best[j] = max(best[j], a[j] + w)


@compiled
def _trace_back(
    head: Array, scores: Array, audio: LogTransitions, visual: LogTransitions, path: Index, start: int
) -> None:
    """Fill in the path before the last frame of a stretch, without back-pointers, from the scores."""
    units, others = len(audio.leaving), len(visual.leaving)
    for t in range(start + len(scores) - 1, start - 1, -1):
        before = scores[t - 1 - start] if t > start else head
        state, other = path[t]
        best = -np.inf
        for v in range(1 + others if other < others else 2):
            to, weight = _find_source(other, v, visual)
            score, source = before[state, to] + audio.stay[state], state
            for u in range(1, 1 + units if state < units else 2):
                origin, of_arc = _find_source(state, u, audio)
                if before[origin, to] + of_arc > score:
                    score, source = before[origin, to] + of_arc, origin
            if score + weight > best:
                best = score + weight
                path[t - 1] = source, to


@compiled
def _find_source(state: int, way: int, loop: LogTransitions) -> tuple[int, float]:
    """Return the state from which a way leads to a state, and its log probability: 0 is to stay."""
    units = len(loop.leaving)
    if way == 0:
        return state, loop.stay[state]
    if state >= units:
        return state - units, loop.onward[state - units]
    return len(loop.stay) - units + way - 1, loop.leaving[way - 1, state]
