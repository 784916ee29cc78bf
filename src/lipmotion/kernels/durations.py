"""The best way to cut frames into the states of a chain, where every length of a state has its own probability."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]
IMPOSSIBLE = -1e12
"""A log probability of nothing that still adds up, and leaves the sums of others their precision."""


def best_durations(log_emission: Array, log_duration: Array, log_longer: Array) -> tuple[NDArray[np.intp], float]:
    """Return how many frames each state of a chain lasts [shape=(S,)], and the log probability (-inf: no way).

    log_emission : [shape=(T, S)], finite or -inf
    log_duration : [shape=(S, D)], of lasting 1 to D frames, finite or -inf
    log_longer   : [shape=(S,), < 0], of every frame more than D
    Every state lasts one frame or more; the first begins with the first frame, the last ends with the last.
    Source: the explicit-duration Viterbi recursion, as of a hidden semi-Markov model.
    Cost: O(T·S·D) time, O(T·S) memory.
    """
    frames, states = log_emission.shape
    sums = np.concatenate([np.zeros((1, states)), np.cumsum(np.maximum(log_emission, IMPOSSIBLE), axis=0)])
    best = np.full((states + 1, frames + 1), -np.inf)
    best[0, 0] = 0.0
    for state in range(states):
        entered = best[state] - sums[:, state]
        best[state + 1] = _after(entered, log_duration[state], float(log_longer[state])) + sums[:, state]
    score = float(best[-1, -1])
    if score < IMPOSSIBLE / 2:
        return np.zeros(states, np.intp), -np.inf
    lasted = np.empty(states, np.intp)
    end = frames
    for state in range(states - 1, -1, -1):
        length = np.arange(1, end + 1)
        known = log_duration[state, np.minimum(length, log_duration.shape[1]) - 1]
        longer = np.maximum(length - log_duration.shape[1], 0) * log_longer[state]
        ways = best[state, end - length] - sums[end - length, state] + known + longer
        lasted[state] = length[ways.argmax()]
        end -= lasted[state]
    return lasted, score


def _after(entered: Array, log_duration: Array, log_longer: float) -> Array:
    """Return the best score of having left a state at each time [shape=(T + 1,)], its emissions left out.

    entered : the score of having entered it at each time, less the emissions up to there [shape=(T + 1,)]
    """
    longest = len(log_duration)
    padded = np.concatenate([np.full(longest, -np.inf), entered])
    ways = sliding_window_view(padded, longest)[: len(entered)] + log_duration[::-1]
    found: Array = ways.max(axis=1)
    time = np.arange(len(entered)) * log_longer
    longer = np.maximum.accumulate(entered - time) + time + log_duration[-1]  # of entering, D frames later at the least
    if len(entered) > longest:
        np.maximum(found[longest:], longer[:-longest], out=found[longest:])
    return found
