"""Random sampling of paths through a network from their posterior."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.sequences.arcs import NetworkArrays

Index = NDArray[np.intp]
Array = NDArray[np.float64]


def sample_paths(
    log_emission: NDArray[np.floating[Any]], network: NetworkArrays, uniform: Array
) -> tuple[Index, float]:
    """Return paths drawn independently from the posterior of all paths.

    log_emission : [shape=(T, G)], finite or -inf
    uniform      : [shape=(N, T)], random numbers from 0 up to 1, one row for each path
    Returns the states of the paths [shape=(N, T)] and the log likelihood; where there is no path, -1 and -inf.
    Source: forward filtering, backward sampling (Carter & Kohn 1994), in the log domain.
    Cost: O(T·E) for the filter, O(T·S) memory; O(T·E / S) a path.
    """
    _, arc_from, arc_log, arc_start, _, log_final = network
    alpha = _forward(log_emission, network)
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


def _forward(log_emission: NDArray[np.floating[Any]], network: NetworkArrays) -> Array:
    """Return the joint log probability of each state and all frames up to each frame [shape=(T, S)]."""
    emission, arc_from, arc_log, arc_start, log_initial, _ = network
    alpha = np.empty((len(log_emission), len(emission)))
    alpha[0] = log_initial + log_emission[0, emission]
    for frame in range(1, len(alpha)):
        np.logaddexp.reduceat(alpha[frame - 1, arc_from] + arc_log, arc_start, out=alpha[frame])
        alpha[frame] += log_emission[frame, emission]
    return alpha


def _drawn(log_weights: Array, uniform: float) -> int:
    """Return a number drawn with probabilities proportional to the weights; ``uniform`` is from 0 up to 1."""
    sums = np.cumsum(np.exp(log_weights - log_weights.max()))
    return int(np.searchsorted(sums, uniform * sums[-1], side="right").clip(max=len(sums) - 1))
