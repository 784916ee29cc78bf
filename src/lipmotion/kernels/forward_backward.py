"""Forward–backward: first as it is defined, for any network of states, then for many left-to-right chains at a time.

``log_forward_backward`` is the definition. The other forms are faster, and tests compare them with it:
``chain_posteriors``, here, and ``ForwardBackwardNetwork`` (``kernels.network``), which falls back on it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiler import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
LOG_ZERO = -1e30  # stands for the log probability -inf: sums and differences of it are no NaN
MIN_LOG = -700.0  # probabilities with smaller logarithms are set to 0
LOG_2 = math.log(2)


@compiled
def log_forward_backward(
    log_initial: Array, log_emission: Array, arc_from: Index, arc_to: Index, arc_log: Array, log_final: Array
) -> tuple[Array, Array, float]:
    """Return the log posteriors of states, the expected counts of arcs, and the log likelihood, of one recording.

    log_initial, log_final : log P of beginning in each state, and of ending in it [shapes=(S,)]
    log_emission : log density of each frame in each state [shape=(T, S)]
    arc_from, arc_to, arc_log : source, target and log P of each arc [shapes=(E,)]
    Returns log P(state of frame t | recording) [shape=(T, S)]; the expected number of times that each arc is followed
    [shape=(E,)]; and log P(recording), -inf if there is no path: then posteriors are -inf, counts 0.

    alpha[t, s] = log P(frames up to t, state s at t); beta[t, s] = log P(frames after t | state s at t).
    Source: Rabiner 1989, §III, in logarithms.  Cost: O(T·E).
    """
    alpha, beta = np.full(log_emission.shape, -np.inf), np.full(log_emission.shape, -np.inf)
    counts, last, log_likelihood = np.zeros(len(arc_log)), len(log_emission) - 1, -np.inf

    alpha[0] = log_initial + log_emission[0]
    for t in range(1, last + 1):
        for arc, source in enumerate(arc_from):
            target = arc_to[arc]
            alpha[t, target] = add_logs(alpha[t, target], alpha[t - 1, source] + arc_log[arc])
        alpha[t] += log_emission[t]
    for log in alpha[last] + log_final:
        log_likelihood = add_logs(log_likelihood, log)
    if log_likelihood == -np.inf:
        return beta, counts, log_likelihood

    beta[last] = log_final
    for t in range(last - 1, -1, -1):
        entered = log_emission[t + 1] + beta[t + 1]
        for arc, source in enumerate(arc_from):
            onward = arc_log[arc] + entered[arc_to[arc]]
            beta[t, source] = add_logs(beta[t, source], onward)
            counts[arc] += math.exp(alpha[t, source] + onward - log_likelihood)
    return alpha + beta - log_likelihood, counts, log_likelihood


def chain_posteriors(
    log_emission: NDArray[np.float64],
    log_stay: NDArray[np.float64],
    log_move: NDArray[np.float64],
    frames: NDArray[np.intp],
    states: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return posteriors of chains without skips, each entered in its first state and left from its last.

    They are those of ``log_forward_backward``, for networks in which each state leads to itself and to the next one.

    log_emission : [shape=(T, U, S)], U utterances padded to T frames and S states, with any finite number
    log_stay, log_move : [shape=(U, S)], of transitions to the same and to the next state
    frames, states     : [shape=(U,)], of each utterance without padding
    Returns the posterior of each state [shape=(T, U, S)], 0 in the padding; the expected number of transitions of each
    state to itself [shape=(U, S)]; and the log likelihood [shape=(U,)]. Where it is <= LOG_ZERO / 2 there is
    no path (fewer frames than states), and the other two are 0.
    Cost: O(T·U·S).
    """
    log_posterior, log_stays, log_likelihood = _chains(log_emission, log_stay, log_move, frames, states)
    possible = log_likelihood > LOG_ZERO / 2
    within = frames > np.arange(len(log_emission))[:, None]
    posterior, stays = _probabilities(log_posterior), _probabilities(log_stays)
    posterior *= (within & possible)[:, :, None]
    return posterior, stays.sum(axis=0) * possible[:, None], log_likelihood


def _probabilities(log: Array) -> Array:
    """Return exp of logarithms, which are at most 0 but for rounding; 0 under ``MIN_LOG``, as denormals are slow."""
    return np.exp(np.minimum(log, 0, out=log), out=np.zeros_like(log), where=log > MIN_LOG)


@compiled
def _chains(
    log_emission: Array, log_stay: Array, log_move: Array, frames: Index, states: Index
) -> tuple[Array, Array, Array]:
    """Return log posteriors of states and of staying in them [shapes=(T, U, S)], and log likelihoods [shape=(U,)]."""
    posterior, stays = np.full(log_emission.shape, LOG_ZERO), np.full(log_emission.shape, LOG_ZERO)
    log_likelihood = np.empty(len(frames))
    for u in range(len(frames)):
        T, S = frames[u], states[u]
        emission, stay, move = log_emission[:T, u, :S], log_stay[u], log_move[u]
        alpha = posterior[:T, u, :S]  # forward scores, from which posteriors are made in place
        alpha[0, 0] = emission[0, 0]
        for t in range(1, T):
            alpha[t, 0] = max(alpha[t - 1, 0] + stay[0] + emission[t, 0], LOG_ZERO)
            for s in range(1, S):
                arrive = add_logs(alpha[t - 1, s] + stay[s], alpha[t - 1, s - 1] + move[s - 1])
                alpha[t, s] = max(arrive + emission[t, s], LOG_ZERO)
        total = log_likelihood[u] = alpha[T - 1, S - 1] + move[S - 1]
        beta, onward = np.full(S, LOG_ZERO), np.empty(S)
        beta[S - 1] = move[S - 1]
        for t in range(T - 1, -1, -1):
            if t + 1 < T:
                for s in range(S):
                    onward[s] = emission[t + 1, s] + beta[s]
                for s in range(S):
                    keep = stay[s] + onward[s]
                    stays[t, u, s] = alpha[t, s] + keep - total
                    reach = add_logs(keep, move[s] + onward[s + 1]) if s + 1 < S else keep
                    beta[s] = max(reach, LOG_ZERO)
            for s in range(S):
                alpha[t, s] = alpha[t, s] + beta[s] - total
    return posterior, stays, log_likelihood


@compiled
def add_logs(x: float, y: float) -> float:
    """Return the logarithm of the sum of two probabilities."""
    if x == y:
        return x + LOG_2
    high, low = max(x, y), min(x, y)
    if high - low > 40 and abs(high) > 1:
        return high  # the lower one adds less than a quarter of the last bit
    return high + math.log1p(math.exp(low - high))
