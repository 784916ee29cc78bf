"""Forward–backward: first as it is defined, for any network of states, then for many left-to-right chains at a time.

``log_forward_backward`` is the definition. The other forms are faster, and tests compare them with it:
``chain_posteriors``, here, and ``ForwardBackwardNetwork`` (``kernels.sequences.network``), which falls back on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.choice import compiled_pays

Array = NDArray[np.float64]
Index = NDArray[np.intp]
IMPOSSIBLE = -1e30
"""Stands for the log probability -inf: sums and differences of it are no NaN."""
LEAST_LOG = -700.0
"""Probabilities with smaller logarithms are set to 0."""
CELL_S = 60e-9
"""Time that NumPy takes for one state of one utterance in one frame (docs/results/kernels.md)."""


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
    alpha, beta = np.full((2, *log_emission.shape), -np.inf)
    counts, last = np.zeros(len(arc_log)), len(log_emission) - 1

    alpha[0] = log_initial + log_emission[0]
    for t in range(1, last + 1):
        np.logaddexp.at(alpha[t], arc_to, alpha[t - 1, arc_from] + arc_log)
        alpha[t] += log_emission[t]
    log_likelihood = float(np.logaddexp.reduce(alpha[last] + log_final))
    if np.isneginf(log_likelihood):
        return beta, counts, log_likelihood

    beta[last] = log_final
    for t in range(last - 1, -1, -1):
        onward = arc_log + (log_emission[t + 1] + beta[t + 1])[arc_to]
        np.logaddexp.at(beta[t], arc_from, onward)
        counts += np.exp(alpha[t, arc_from] + onward - log_likelihood)
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
    state to itself [shape=(U, S)]; and the log likelihood [shape=(U,)]. Where it is <= IMPOSSIBLE / 2 there is
    no path (fewer frames than states), and the other two are 0.
    Cost: O(T·U·S).
    """
    arrays = (log_emission, log_stay, log_move, frames, states)
    if compiled_pays(log_emission.size * CELL_S):
        from lipmotion.kernels.compiled import forward_backward

        log_posterior, log_kept, log_likelihood = forward_backward.chains(*arrays)
    else:
        log_posterior, log_kept, log_likelihood = _chains(*arrays)
    possible = log_likelihood > IMPOSSIBLE / 2
    within = frames > np.arange(len(log_emission))[:, None]
    posterior, kept = _probabilities(log_posterior), _probabilities(log_kept)
    posterior *= (within & possible)[:, :, None]
    return posterior, kept.sum(axis=0) * possible[:, None], log_likelihood


def _probabilities(log: Array) -> Array:
    """Return exp of logarithms, which are at most 0 but for rounding; 0 under ``LEAST_LOG``, as denormals are slow."""
    return np.exp(np.minimum(log, 0, out=log), out=np.zeros_like(log), where=log > LEAST_LOG)


def _chains(
    log_emission: Array, log_stay: Array, log_move: Array, frames: NDArray[np.intp], states: NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Return log posteriors of each state, and of staying in it for the next frame [shapes=(T, U, S)], and log
    likelihoods [shape=(U,)]. In the padding, posteriors have no meaning.
    """
    T, U, S = log_emission.shape
    alpha = np.full((T, U, S), IMPOSSIBLE)
    alpha[0, :, 0] = log_emission[0, :, 0]
    for t in range(1, T):
        arrive = alpha[t - 1] + log_stay
        moved = (alpha[t - 1] + log_move)[:, :-1]
        arrive[:, 1:] = np.logaddexp(arrive[:, 1:], moved)
        np.maximum(arrive + log_emission[t], IMPOSSIBLE, out=alpha[t])
    rows = np.arange(U)
    leave = np.full((U, S), IMPOSSIBLE)
    leave[rows, states - 1] = log_move[rows, states - 1]
    log_likelihood = (alpha[frames - 1, rows] + leave).max(axis=1)

    beta, log_kept = np.full((T, U, S), IMPOSSIBLE), np.full((T, U, S), IMPOSSIBLE)
    for t in range(T - 1, -1, -1):
        last = (frames == t + 1)[:, None]
        if t + 1 < T:
            onward = log_emission[t + 1] + beta[t + 1]
            kept = log_stay + onward
            reach = kept.copy()
            reach[:, :-1] = np.logaddexp(kept[:, :-1], log_move[:, :-1] + onward[:, 1:])
            np.maximum(reach, IMPOSSIBLE, out=beta[t])
            log_kept[t] = np.where((frames > t + 1)[:, None], alpha[t] + kept - log_likelihood[:, None], IMPOSSIBLE)
        beta[t] = np.where(last, leave, beta[t])
    return alpha + beta - log_likelihood[:, None], log_kept, log_likelihood
