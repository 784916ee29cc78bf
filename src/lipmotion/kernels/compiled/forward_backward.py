"""Posteriors of chains, compiled: the same operations in the same order as in ``kernels.sequences.forward_backward``.

Where NumPy and numba call the same C library for exp and log1p, as on Linux, the results are the same to the bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.compiled.compiler import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
LOG_ZERO = -1e30
LOG_2 = math.log(2)


@compiled
def chains(
    log_emission: Array, log_stay: Array, log_move: Array, frames: Index, states: Index
) -> tuple[Array, Array, Array]:
    """Return log posteriors of states and of staying in them, and log likelihoods (as NumPy's form, ``_chains``)."""
    posterior, kept = np.full(log_emission.shape, LOG_ZERO), np.full(log_emission.shape, LOG_ZERO)
    log_likelihood = np.empty(len(frames))
    for u in range(len(frames)):
        T, S = frames[u], states[u]
        emission = log_emission[:T, u, :S]
        alpha, log_kept = posterior[:T, u, :S], kept[:T, u, :S]
        _forward(emission, log_stay[u], log_move[u], alpha)
        log_likelihood[u] = alpha[T - 1, S - 1] + log_move[u, S - 1]
        _backward(emission, log_stay[u], log_move[u], alpha, log_kept, log_likelihood[u])
    return posterior, kept, log_likelihood


@compiled
def _forward(log_emission: Array, log_stay: Array, log_move: Array, alpha: Array) -> None:
    """Fill in the forward scores [shape=(T, S)]."""
    alpha[0, 0] = log_emission[0, 0]
    for t in range(1, len(alpha)):
        alpha[t, 0] = max(alpha[t - 1, 0] + log_stay[0] + log_emission[t, 0], LOG_ZERO)
        for s in range(1, alpha.shape[1]):
            arrive = _log_sum(alpha[t - 1, s] + log_stay[s], alpha[t - 1, s - 1] + log_move[s - 1])
            alpha[t, s] = max(arrive + log_emission[t, s], LOG_ZERO)


@compiled
def _backward(
    log_emission: Array, log_stay: Array, log_move: Array, alpha: Array, kept: Array, log_likelihood: float
) -> None:
    """Replace the forward scores ``alpha`` by log posteriors, and fill in those of staying in a state."""
    T, S = alpha.shape
    beta = np.full(S, LOG_ZERO)
    beta[S - 1] = log_move[S - 1]
    onward = np.empty(S)
    for t in range(T - 1, -1, -1):
        if t + 1 < T:
            for s in range(S):
                onward[s] = log_emission[t + 1, s] + beta[s]
            for s in range(S):
                keep = log_stay[s] + onward[s]
                kept[t, s] = alpha[t, s] + keep - log_likelihood
                reach = _log_sum(keep, log_move[s] + onward[s + 1]) if s + 1 < S else keep
                beta[s] = max(reach, LOG_ZERO)
        for s in range(S):
            alpha[t, s] = alpha[t, s] + beta[s] - log_likelihood


@compiled
def _log_sum(x: float, y: float) -> float:
    """Return log(exp(x) + exp(y))."""
    if x == y:
        return x + LOG_2
    high, low = max(x, y), min(x, y)
    if high - low > 40 and abs(high) > 1:
        return high  # the lower one adds less than a quarter of the last bit
    return high + math.log1p(math.exp(low - high))
