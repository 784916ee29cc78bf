"""State posteriors of left-to-right chains, many utterances at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

IMPOSSIBLE = -1e30
"""A log probability of nothing that still adds up without NaN."""


def chain_posteriors(
    log_emission: NDArray[np.float64],
    log_stay: NDArray[np.float64],
    log_move: NDArray[np.float64],
    frames: NDArray[np.intp],
    states: NDArray[np.intp],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return posteriors of chains without skips, each entered in its first state and left from its last.

    log_emission : [shape=(T, U, S)], U utterances padded to T frames and S states (padding: anything finite)
    log_stay, log_move : [shape=(U, S)], to the same and to the next state
    frames, states     : [shape=(U,)], the true lengths
    Returns posterior [shape=(T, U, S)] of each state, 0 in the padding; stay [shape=(U, S)], the expected
    number of times each state was kept; log likelihood [shape=(U,)]. Where it is <= IMPOSSIBLE / 2 there is
    no path (fewer frames than states), and the other two are 0.
    Source: the standard recursions, in the log domain.  Cost: O(T·U·S).
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

    beta = np.full((T, U, S), IMPOSSIBLE)
    stay = np.zeros((U, S))
    for t in range(T - 1, -1, -1):
        if t + 1 < T:
            onward = log_emission[t + 1] + beta[t + 1]
            kept = log_stay + onward
            reach = kept.copy()
            reach[:, :-1] = np.logaddexp(kept[:, :-1], log_move[:, :-1] + onward[:, 1:])
            np.maximum(reach, IMPOSSIBLE, out=beta[t])
            stay += np.exp(np.minimum(alpha[t] + kept - log_likelihood[:, None], 0)) * (frames > t + 1)[:, None]
        beta[t] = np.where((frames == t + 1)[:, None], leave, beta[t])
    posterior = np.exp(np.minimum(alpha + beta - log_likelihood[:, None], 0))
    possible = log_likelihood > IMPOSSIBLE / 2
    posterior *= ((frames > np.arange(T)[:, None]) & possible)[:, :, None]
    return posterior, stay * possible[:, None], log_likelihood
