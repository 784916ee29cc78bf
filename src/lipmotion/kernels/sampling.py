"""Paths through a network drawn at random, each as often as it is probable."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]
Array = NDArray[np.float64]


def sample_paths(
    log_emission: NDArray[np.floating[Any]],
    emission: Index,
    arc_from: Index,
    arc_log: NDArray[np.floating[Any]],
    arc_start: Index,
    log_initial: NDArray[np.floating[Any]],
    log_final: NDArray[np.floating[Any]],
    uniform: Array,
) -> tuple[Index, float]:
    """Return independent paths, each drawn with its posterior probability.

    log_emission : [shape=(T, G)], finite or -inf
    emission     : [shape=(S,)], the density of each state
    arc_from     : [shape=(E,)], the source states of all arcs, sorted by target
    arc_log      : [shape=(E,)], log probabilities
    arc_start    : [shape=(S,)], where each target's arcs begin; every state has at least one
    log_initial, log_final : [shape=(S,)], of beginning and ending in each state
    uniform      : [shape=(N, T)], random numbers from 0 up to 1, a row a path
    Returns paths [shape=(N, T)] and the log likelihood; where there is no path, -inf and paths of -1.
    Source: forward filtering, backward sampling (Carter & Kohn 1994), in the log domain.
    Cost: O(T·E) for the filter, O(T·S) memory; O(T·E / S) a path.
    """
    alpha = _filtered(log_emission, emission, arc_from, arc_log, arc_start, log_initial)
    last = alpha[-1] + log_final
    log_likelihood = float(np.logaddexp.reduce(last))
    paths = np.full((len(uniform), len(alpha)), -1, np.intp)
    if not np.isfinite(log_likelihood):
        return paths, -np.inf
    stops = np.append(arc_start[1:], len(arc_from))
    for path, draws in zip(paths, uniform, strict=True):
        state = path[-1] = _drawn(last, float(draws[-1]))
        for frame in range(len(alpha) - 2, -1, -1):
            arcs = slice(arc_start[state], stops[state])
            sources = arc_from[arcs]
            state = path[frame] = sources[_drawn(alpha[frame, sources] + arc_log[arcs], float(draws[frame]))]
    return paths, log_likelihood


def _filtered(
    log_emission: NDArray[np.floating[Any]],
    emission: Index,
    arc_from: Index,
    arc_log: NDArray[np.floating[Any]],
    arc_start: Index,
    log_initial: NDArray[np.floating[Any]],
) -> Array:
    """Return the log probability of being in each state, and of all frames so far [shape=(T, S)]."""
    alpha = np.empty((len(log_emission), len(emission)))
    alpha[0] = log_initial + log_emission[0, emission]
    for frame in range(1, len(alpha)):
        np.logaddexp.reduceat(alpha[frame - 1, arc_from] + arc_log, arc_start, out=alpha[frame])
        alpha[frame] += log_emission[frame, emission]
    return alpha


def _drawn(log_weights: Array, uniform: float) -> int:
    """Return the number of the weight that a random number falls into."""
    sums = np.cumsum(np.exp(log_weights - log_weights.max()))
    return int(np.searchsorted(sums, uniform * sums[-1], side="right").clip(max=len(sums) - 1))
