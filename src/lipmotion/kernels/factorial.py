"""Posteriors and expected counts of factorial hidden Markov models (``kernels.factorial_loops``), by forward–backward.

Each loop has transitions along its own axis of the joint states only, so a frame costs Na·Nv·(Ua + Uv) and not
(Na·Nv)², and the matrix of joint transitions is never computed.

Probabilities of a frame are scaled to sum to ``WHOLE``, and raised to 1 / ``WHOLE`` where they are less. Densities are
multiplied in double precision, and products under a least value are set to 0. So no number is denormal, which would be
many times slower, nor the product of two probabilities. What that may lose is bounded, and where it is too much, the
recording is computed in logarithms: slow, and exact however improbable a path is.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compile_to_rounding, compiled
from lipmotion.kernels.factorial_loops import (
    FactorialLogLikelihoods,
    LogTransitions,
    Loop,
    LoopCounts,
    count_cached_frames,
    join_logs,
    log_ends,
)
from lipmotion.kernels.forward_backward import add_logs

Array = NDArray[Any]
Index = NDArray[np.intp]
Double = NDArray[np.float64]
OFF = 1e-10  # the largest share of the likelihood that may come of probabilities that were raised
WHOLE = 1e70  # the sum of the probabilities of a frame. They are raised to 1 divided by this where they are less
MIN_PRODUCT = 1e-300  # smaller products of probabilities and densities are set to 0
MIN_TOTAL = 1e-150
"""Least sum of these products, as a share of the whole. With such a sum, what was set to 0 or underflowed is less than
what probabilities are raised to."""
MIN_POSTERIOR = 1e-20  # smaller posteriors and counts are set to 0, as those of states that cannot be are not quite 0
MIN_PROBABILITY = 1e-100
"""Least probability of a transition, or of beginning or ending in a state: products of smaller ones may underflow."""
SPARSE_SHARE = 0.2  # a smaller share of possible joint states is fastest in logarithms, which take no time for others
LARGEST_EXPONENT = 700.0
"""Expected transitions are divided by the probability of the transition: the quotient must stay finite."""
SAFE_EXPONENT = 300.0  # the product of so great an exponential and one that underflows is negligible
MIN_SUM = 1e-280  # a sum of at least so much loses nothing by terms under e^-LARGEST_EXPONENT
MIN_LOG_SHARE = -60.0  # what has less of a sum, as logarithm, is less than the rounding, and than ``MIN_POSTERIOR``


class FactorialPosteriors(NamedTuple):
    """Posteriors and expected counts of a recording in two loops.

    audio, visual : [shapes=(T, Na), (T, Nv)], posteriors of the states of each loop
    pair          : [shape=(T, P)], posteriors of the joint states with densities of their own
    audio_counts, visual_counts : expected counts of the transitions of each loop
    log_likelihood : -inf where there is no path: then everything else is 0
    Posteriors and counts under 1e-20 are 0.

    Guaranteed but for rounding, however improbable a path is at first: the likelihood is right to a share of δ, and the
    errors of the posteriors of a frame, or of the counts of a step from frame to frame, sum to 3 δ at most; δ: ``OFF``.
    """

    audio: Array
    visual: Array
    pair: Array
    audio_counts: LoopCounts
    visual_counts: LoopCounts
    log_likelihood: float


def infer_factorial(
    audio: Loop, visual: Loop, logs: FactorialLogLikelihoods, stretch: int | None = None
) -> FactorialPosteriors:
    """Return the posteriors and expected counts of a recording in two loops.

    stretch : frames whose forward probabilities are stored at once, others are computed twice; None: √T, or what fits
    Where few joint states are possible, or double precision may lose paths that count, because they were some 250 nats
    below a frame's best, the recording is processed in logarithms.
    Source: Ghahramani & Jordan (1997), "Factorial hidden Markov models", appendix B. Forward and backward probabilities
    are raised to a least one, so they are upper bounds; how much comes of that follows from their overlap in a frame.
    Cost: time O(T·Na·Nv·(Ua + Uv)), memory O(stretch + T/stretch) times Na·Nv.
    """
    order = np.lexsort(logs.pairs.T[::-1])
    logs = logs._replace(pair=logs.pair.take(order, axis=1), pairs=logs.pairs[order])
    share = np.prod([np.mean(log > -np.inf) for log in (logs.audio, logs.visual)])
    probabilities = (p for loop in (audio, visual) for p in (*_moves(loop), loop.initial, loop.final))
    lowest = min(float(part.min(where=part > 0, initial=1.0)) for part in probabilities)
    is_scaled = lowest >= MIN_PROBABILITY and share > SPARSE_SHARE
    ways = (way(audio, visual, logs) for way in ((_Scaled, _InLogs) if is_scaled else (_InLogs,)))
    results = (_forward_backward((audio, visual), logs, way, stretch) for way in ways)
    result = next(each for each in results if each is not None)
    return result._replace(pair=result.pair[:, np.argsort(order)])


def _forward_backward(
    loops: tuple[Loop, Loop], logs: FactorialLogLikelihoods, way: _Scaled | _InLogs, stretch: int | None
) -> FactorialPosteriors | None:
    """Return the posteriors, computed in a way; None: its precision is not enough."""
    frames = len(logs.audio)
    stretch = stretch or count_cached_frames(frames, way.initial.nbytes)
    starts, heads, log_likelihood = range(0, frames, stretch), list[Array | None](), 0.0
    forward: Forward = []
    for start in starts:
        heads.append(forward[-1][0] if forward else None)
        forward.clear()  # its memory is needed
        log_likelihood += way.forward(start, min(start + stretch, frames), heads[-1], forward)
        if log_likelihood == -math.inf:
            return None
    posteriors = np.zeros(logs.audio.shape), np.zeros(logs.visual.shape), np.zeros(logs.pair.shape)
    entered = np.zeros(loops[0].enter.shape), np.zeros(loops[1].enter.shape)
    for start, head in zip(reversed(starts), reversed(heads), strict=True):
        if start != starts[-1]:
            forward.clear()
            way.forward(start, start + stretch, head, forward)
        log_overlaps = way.back(start, forward, posteriors, entered)
        if not min(log_overlaps) >= way.min_log_overlap:
            return None
        if start == starts[-1]:
            log_likelihood += log_overlaps[-1]
    counts = _counted(loops[0], posteriors[0], entered[0]), _counted(loops[1], posteriors[1], entered[1])
    for part in (*posteriors, *counts[0], *counts[1]):
        part[part < MIN_POSTERIOR] = 0
    return FactorialPosteriors(*posteriors, *counts, log_likelihood)


Forward = list[tuple[Array, Array]]
Posteriors = tuple[Double, Double, Double]
Entered = tuple[Double, Double]


class _Scaled:
    """Steps of forward–backward with scaled probabilities."""

    def __init__(self, audio: Loop, visual: Loop, logs: FactorialLogLikelihoods) -> None:
        self.logs = logs
        self.initial, self.final = log_ends(audio, visual)
        self.audio, self.visual = _moves(audio), _moves(visual)
        self.start, self.densities = 0, list[tuple[Array, Array, Array, float]]()
        self.after = self.initial, self.initial  # of the frame after: backward probabilities times densities, leaving
        # In a frame, what was raised is 1 / whole² at most for each joint state, forward and backward, times the sum of
        # all that leads to a state or from it: up to U + 2 ≤ 3 U in each loop.
        raised = 2 * len(logs.audio) * 9 * self.initial.size / WHOLE**2
        self.min_log_overlap = math.log(raised / OFF)

    def forward(self, start: int, stop: int, before: Array | None, results: Forward) -> float:
        """Append the forward probabilities of some frames, and those of leaving the last visual states after the audio
        loop's transition only [shape=(Na, Uv)]; return the log of the product of their scales.
        """
        self.start, self.densities = start, self.logs.densities(start, stop)
        (stay, onward, leave), log_total = self.audio, 0.0
        units, count = len(leave), len(self.visual[2])
        for audio, visual, pair, best in self.densities:
            if before is None:
                before, log = self._shares(self.initial + join_logs(self.logs, 0))
                results.append((before, before[:, :count]))
                log_total += log
                continue
            entering, last, after = leave.T @ before[-units:], before[:, -count:], np.empty_like(before)
            moved = stay[:, None] * last
            moved[:units] += entering[:, -count:]
            moved[units:] += onward[:, None] * last[:-units]
            total = _forward(
                before, stay, onward, entering, *self.visual[:2], moved @ self.visual[2],
                audio, visual, pair, self.logs.pairs,
                MIN_PRODUCT, WHOLE, after,
            )  # fmt: skip
            if not total > MIN_TOTAL:
                return -math.inf
            log_total += math.log(total) + best
            results.append((after, moved))
            before = after
        return log_total

    def back(self, start: int, forward: Forward, posteriors: Posteriors, entered: Entered) -> Double:
        """Fill in the posteriors of some frames; add their expected numbers of transitions by their probabilities.

        Returns the logarithms of the sums of forward times backward probabilities, as shares of both wholes.
        """
        log_overlaps = np.full(len(forward), -np.inf)
        for t in range(start + len(forward) - 1, start - 1, -1):
            before, sums = forward[t - start][0], [part[t] for part in posteriors]
            backward, leaving = self.after
            if t == len(self.logs.audio) - 1:
                after, log = self._shares(self.final + join_logs(self.logs, t))
                if not log > -math.inf:
                    break
                rows, columns = map(np.arange, before.shape)
                log_overlap = _meet_in_logs(np.log(before), self.final, self.logs.pairs, rows, columns, *sums)
                log_overlap -= math.log(WHOLE)
            else:
                audio, visual, pair, _ = self.densities[t - self.start]
                (stay, onward, leave), units, count = self.visual, len(self.audio[2]), len(self.visual[2])
                first, moved = backward[:, :count], stay * backward
                moved[:, :-count] += onward * backward[:, count:]
                moved[:, -count:] += first @ leave.T
                after = np.empty_like(before)
                total = _backward(
                    before, moved, *self.audio[:2], self.audio[2] @ moved[:units], audio, visual, pair,
                    self.logs.pairs, MIN_PRODUCT, WHOLE, after, *sums,
                )  # fmt: skip
                met = float(sums[0].sum())
                if not (met > 0 and total > MIN_TOTAL):
                    break
                for values in sums:
                    values[:] = values / met
                entered[0][:] += before[-units:] @ moved[:units].T / met
                entered[1][:] += leaving.T @ first / met
                log_overlap = math.log(met) - 2 * math.log(WHOLE)
            log_overlaps[t - start], self.after = log_overlap, (after, forward[t - start][1])
            if not log_overlap >= self.min_log_overlap:
                break
        return log_overlaps

    def _shares(self, joint: Double) -> tuple[Array, float]:
        """Return probabilities, scaled, and the log of their sum before, from log probabilities."""
        best = float(joint.max())
        if not math.isfinite(best):
            return np.zeros(joint.shape), -math.inf
        joint = np.exp(joint - best)
        total = float(joint.sum())
        return np.maximum(joint * (WHOLE / total), 1 / WHOLE), math.log(total) + best


def _moves(loop: Loop) -> tuple[Array, Array, Array]:
    """Return probabilities of staying, of going on, and from each unit's last state to each unit's first."""
    return loop.stay.ravel(), loop.onward.ravel(), loop.leave[:, None] * loop.enter


class _InLogs:
    """The steps of ``_Scaled`` in logarithms: those of backward probabilities and densities, too."""

    min_log_overlap = -math.inf  # of a recording without a path

    def __init__(self, audio: Loop, visual: Loop, logs: FactorialLogLikelihoods) -> None:
        self.loops, self.logs = (LogTransitions.of(audio), LogTransitions.of(visual)), logs.to_doubles()
        self.back_loops = self.loops[0].reverse(), self.loops[1].reverse()
        self.initial, self.final = log_ends(audio, visual)
        possible = []
        for log, states in zip((logs.audio, logs.visual), logs.pairs.T, strict=True):
            paired = (logs.pair > -np.inf).astype(np.float32) @ np.eye(log.shape[1], dtype=np.float32)[states]
            possible.append((log > -np.inf) | (paired > 0))
        self.possible = possible[0], possible[1]
        self.after = self.initial, self.initial  # of the frame after: backward probabilities times densities, leaving

    def forward(self, start: int, stop: int, before: Array | None, results: Forward) -> float:
        self.joint = np.full((stop - start, *self.initial.shape), -np.inf)
        self.leaving = np.empty((*self.joint.shape[:2], len(self.loops[1].leaving)))
        before = self.initial if before is None else before
        _forward_in_logs(before, self.loops, self.logs, self.possible, start, self.joint, self.leaving)
        results.extend(zip(self.joint, self.leaving, strict=True))
        return 0.0

    def back(self, start: int, _: Forward, posteriors: Posteriors, entered: Entered) -> Double:
        parts, known = (self.joint, self.leaving, *self.after), (self.final, self.logs, self.possible)
        log_overlaps, backward = _back_in_logs(*parts, self.back_loops, *known, start, posteriors, entered)
        self.after = backward, self.leaving[0]
        return log_overlaps


Loops = tuple[LogTransitions, LogTransitions]
Possible = tuple[NDArray[np.bool_], NDArray[np.bool_]]


@compiled
def _forward_in_logs(
    before: Double, loops: Loops, logs: FactorialLogLikelihoods, possible: Possible, start: int, joint: Double,
    leaving: Double,
) -> None:  # fmt: skip
    """Fill in the forward log probabilities of some frames [shape=(n, Na, Nv), all -inf], and those of leaving.

    before : of the frame before; of the first frame, of beginning
    """
    columns, moved = np.flatnonzero(possible[1][max(start - 1, 0)]), np.full_like(before, -np.inf)
    for t in range(start, start + len(joint)):
        after, rows, before_columns = joint[t - start], np.flatnonzero(possible[0][t]), columns
        columns = np.flatnonzero(possible[1][t])
        if t == 0:
            for i in rows:
                after[i, columns] = before[i, columns]
        else:
            moved[:] = -np.inf
            _move_logs(before, loops[0], rows, before_columns, moved)
            _move_logs(moved.T, loops[1], columns, rows, after.T)
            leaving[t - start] = moved[:, moved.shape[1] - leaving.shape[2] :]
        _add_densities(logs, t, rows, columns, after)
        before = after


@compiled
def _back_in_logs(
    joint: Double, leaving: Double, backward: Double, leaving_after: Double, loops: Loops, final: Double,
    logs: FactorialLogLikelihoods, possible: Possible, start: int, posteriors: Posteriors,
    entered: Entered,
) -> tuple[Double, Double]:  # fmt: skip
    """Fill in the posteriors of some frames, add to entries; return log overlaps, and backward times densities.

    joint, leaving : of ``_forward_in_logs``; ``backward``, ``leaving_after``: of the frame after these
    loops          : reversed
    """
    log_overlaps, units, others = np.empty(len(joint)), len(entered[0]), len(entered[1])
    rows_after = np.flatnonzero(possible[0][min(start + len(joint), len(logs.audio) - 1)])
    moved, beta, backward = np.full_like(final, -np.inf), np.full_like(final, -np.inf), backward.copy()
    for t in range(start + len(joint) - 1, start - 1, -1):
        before, rows, columns = joint[t - start], np.flatnonzero(possible[0][t]), np.flatnonzero(possible[1][t])
        moved[:], beta[:] = -np.inf, -np.inf
        if t + 1 == len(logs.audio):
            for i in rows:
                beta[i, columns] = final[i, columns]
        else:
            turned = moved.shape[1] - 1 - columns[::-1], len(moved) - 1 - rows[::-1]
            _move_logs(backward.T[::-1], loops[1], turned[0], rows_after, moved.T[::-1])
            _move_logs(moved[::-1], loops[0], turned[1], columns, beta[::-1])
        sums = posteriors[0][t], posteriors[1][t], posteriors[2][t]
        log_overlap = _meet_in_logs(before, beta, logs.pairs, rows, columns, *sums)
        if t + 1 < len(logs.audio) and log_overlap > -np.inf:
            last, first = before[len(before) - units :, columns], moved[:units, columns]
            _count_entered(last, first, log_overlap, entered[0])
            last, first = leaving_after[rows_after], backward[rows_after, :others]
            _count_entered(last.T, first.T, log_overlap, entered[1])
        _add_densities(logs, t, rows, columns, beta)
        log_overlaps[t - start], leaving_after, rows_after = log_overlap, leaving[t - start], rows
        backward, beta = beta, backward
    return log_overlaps, backward


@compiled
def _add_densities(logs: FactorialLogLikelihoods, t: int, rows: Index, columns: Index, joint: Double) -> None:
    """Add the log densities of a frame in rows and columns, outside of which all is -inf."""
    densities = join_logs(logs, t)
    for i in rows:
        for j in columns:
            joint[i, j] += densities[i, j]


@compiled
def _sum_entering(
    last: Double, loop: LogTransitions, state: int, columns: Index, parts: Double, tops: Double
) -> Double:
    """Return the log probabilities of entering a state, in columns, from ``parts``, relative to the columns' tops.

    Where all that count are so much less that they underflow, they are sums of logarithms.
    """
    sums = np.zeros(len(columns))
    for u in range(len(last)):
        for c in range(len(columns)):
            sums[c] += loop.shares[u, state] * parts[u, c]
    for c in range(len(columns)):
        if sums[c] > MIN_SUM:
            sums[c] = tops[c] + math.log(sums[c])
        else:
            sums[c] = -np.inf
            for u in range(len(last)):
                sums[c] = add_logs(sums[c], last[u, columns[c]] + loop.leaving[u, state])
    return sums


@compiled
def _move_logs(before: Double, loop: LogTransitions, rows: Index, columns: Index, after: Double) -> None:
    """Fill in log probabilities one frame on, along axis 0, in rows and columns, in ascending order."""
    units, last = len(loop.leaving), before[len(before) - len(loop.leaving) :]
    tops, parts = np.empty(len(columns)), np.zeros((units, len(columns)))
    if len(rows) and rows[0] < units:  # some first states are entered
        for c, j in enumerate(columns):
            tops[c] = last[:, j].max()
            for u in range(units):
                if last[u, j] > tops[c] - LARGEST_EXPONENT:
                    parts[u, c] = math.exp(last[u, j] - tops[c])
    for i in rows:
        entering = _sum_entering(last, loop, i, columns, parts, tops) if i < units else tops
        for c, j in enumerate(columns):
            other = entering[c] if i < units else before[i - units, j] + loop.onward[i - units]
            after[i, j] = add_logs(before[i, j] + loop.stay[i], other)


@compiled
def _meet_in_logs(
    before: Double, beta: Double, pairs: Index, rows: Index, columns: Index, audio: Double, visual: Double, pair: Double
) -> float:
    """Fill in the posteriors of a frame and of pairs in it; return the logarithm of the sum of all products."""
    best, total = -np.inf, 0.0
    audio[:], visual[:], pair[:] = 0.0, 0.0, 0.0
    for i in rows:
        for j in columns:
            best = max(best, before[i, j] + beta[i, j])
    if best == -np.inf:
        return best
    for i in rows:
        for j in columns:
            log = before[i, j] + beta[i, j] - best
            if log > MIN_LOG_SHARE:
                share = math.exp(log)
                total += share
                audio[i] += share
                visual[j] += share
    for p in range(len(pairs)):
        i, j = pairs[p]
        pair[p] = math.exp(before[i, j] + beta[i, j] - best) / total
    audio /= total
    visual /= total
    return best + math.log(total)


@compiled
def _count_entered(last: Array, first: Array, log_overlap: float, entered: Double) -> None:
    """Add the sums of the products of leaving units and of entering units [shapes=(U, M)], from logarithms."""
    left, into = np.empty(len(last)), np.empty(len(first))
    for j in range(last.shape[1]):
        top, best = last[:, j].max(), first[:, j].max()
        if top == -np.inf or best == -np.inf:
            continue
        shift = top - log_overlap
        if best + shift > SAFE_EXPONENT:
            for u in range(len(last)):
                for v in range(len(first)):
                    entered[u, v] += math.exp(min(last[u, j] + first[v, j] - log_overlap, LARGEST_EXPONENT))
            continue
        for u in range(len(last)):
            left[u], into[u] = math.exp(last[u, j] - top), math.exp(first[u, j] + shift)
        entered += left[:, None] * into


def _counted(loop: Loop, posterior: Double, entered: Double) -> LoopCounts:
    """Return expected counts, from posteriors and entries: a state is left as often as entered, but for the edges."""
    enter = entered * (loop.leave[:, None] * loop.enter)
    frames = posterior.reshape(-1, *loop.stay.shape)
    gained = frames[-1] - frames[0]
    after = np.cumsum(gained[::-1], axis=0)[::-1] - gained
    left = np.maximum(enter.sum(axis=1) + after, 0)
    stay = np.maximum(frames[:-1].sum(axis=0) - left, 0)
    return LoopCounts(stay, left[:-1], enter)


@compile_to_rounding
def _forward(
    before: Array, stay_0: Array, onward_0: Array, entering_0: Array, stay_1: Array, onward_1: Array, entering_1: Array,
    density_0: Array, density_1: Array, pair: Array, pairs: Index, floor: float, mass: float,
    after: Array,
) -> float:  # fmt: skip
    """Fill in joint probabilities one frame on along both axes, times densities, normalised; return their sum before.

    entering_0, entering_1 : [shapes=(U, M), (N, U)], probabilities of entering the first states
    pair, pairs : the densities of pairs, and the two states of each, sorted by the first [shape=(P, 2)]
    """
    moved, prior = np.empty(before.shape[1], before.dtype), np.empty(before.shape[1], before.dtype)
    units, others, p = len(entering_0), entering_1.shape[1], 0
    rest, moved_rest, stay_rest = prior[others:], moved[others:], stay_1[others:]
    for i in range(len(before)):
        if i < units:
            _combine(before[i], stay_0[i], entering_0[i], 1.0, moved)
        else:
            _combine(before[i], stay_0[i], before[i - units], onward_0[i - units], moved)
        entering = entering_1[i]
        for j in range(others):
            prior[j] = stay_1[j] * moved[j] + entering[j]
        for j in range(len(onward_1)):
            rest[j] = stay_rest[j] * moved_rest[j] + onward_1[j] * moved[j]
        p = _emit(prior, i, p, density_0, density_1, pair, pairs, floor, after[i])
    return _share(after, mass)


@compile_to_rounding
def _backward(
    before: Array, moved: Array, stay: Array, onward: Array, left: Array,
    density_0: Array, density_1: Array, pair: Array, pairs: Index, floor: float, mass: float,
    after: Array, posterior_0: Array, posterior_1: Array, posterior_pair: Array,
) -> float:  # fmt: skip
    """Fill in posteriors, not normalised, and backward probabilities times densities, normalised; return their sum.

    moved : backward probabilities that were moved back along axis 1; they are moved along axis 0 here
    left  : [shape=(U, M)], those of leaving the last states
    """
    beta = np.empty(before.shape[1], before.dtype)
    units, inner, p = len(left), len(before) - len(left), 0
    posterior_1[:] = 0
    for i in range(len(before)):
        if i < inner:
            _combine(moved[i], stay[i], moved[i + units], onward[i], beta)
        else:
            _combine(moved[i], stay[i], left[i - inner], 1.0, beta)
        alpha, total, first = before[i], 0.0, p
        for j in range(len(beta)):
            product = alpha[j] * beta[j]
            posterior_1[j] += product
            total += product
        posterior_0[i] = total
        p = _emit(beta, i, p, density_0, density_1, pair, pairs, floor, after[i])
        for q in range(first, p):
            posterior_pair[q] = alpha[pairs[q, 1]] * beta[pairs[q, 1]]
    return _share(after, mass)


@compile_to_rounding
def _combine(one: Array, weight: float, other: Array, other_weight: float, into: Array) -> None:
    for j in range(len(into)):
        into[j] = weight * one[j] + other_weight * other[j]


@compile_to_rounding
def _emit(
    prior: Array, i: int, p: int, density_0: Array, density_1: Array, pair: Array, pairs: Index, floor: float,
    into: Array,
) -> int:  # fmt: skip
    """Fill in row i times its densities; its pairs are from p on: return the first pair of the next row."""
    density = density_0[i]
    for j in range(len(prior)):
        partly = prior[j] * density
        product = (partly if partly > floor else 0.0) * density_1[j]
        into[j] = product if product > floor else 0.0
    while p < len(pairs) and pairs[p, 0] == i:
        product = prior[pairs[p, 1]] * pair[p]
        into[pairs[p, 1]] = product if product > floor else 0.0
        p += 1
    return p


@compile_to_rounding
def _share(joint: Array, mass: float) -> float:
    """Make probabilities sum to ``mass``, raised to 1 / ``mass`` at least; return their sum before, by ``mass``."""
    flat, total = joint.reshape(joint.size), 0.0
    for j in range(len(flat)):
        total += flat[j]
    scale, floor = mass / total if total > 0 else 0.0, 1 / mass
    for j in range(len(flat)):
        share = flat[j] * scale
        flat[j] = share if share > floor else floor
    return total / mass
