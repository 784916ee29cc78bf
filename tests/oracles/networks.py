"""Posteriors of networks by enumeration of all state paths."""

from itertools import pairwise, product

import numpy as np

from oracles.paths import path_score


def posteriors(log_emission, emission, arcs, log_initial, log_final):
    """Return posterior [shape=(T, S)], expected count of each arc (as ``arcs``) and log likelihood (-inf: no path).

    arcs : dict of (source, target) to log probability; what is not in it cannot be
    """
    frames, states = len(log_emission), len(emission)
    posterior, counts = np.zeros((frames, states)), dict.fromkeys(arcs, 0.0)
    paths = list(product(range(states), repeat=frames))
    scores = np.array([path_score(path, log_emission, emission, arcs, log_initial, log_final) for path in paths])
    log_likelihood = np.logaddexp.reduce(scores)
    if np.isneginf(log_likelihood):
        return posterior, counts, -np.inf
    for path, weight in zip(paths, np.exp(scores - log_likelihood), strict=True):
        if weight > 0:
            posterior[range(frames), path] += weight
            for step in pairwise(path):
                counts[step] += weight
    return posterior, counts, log_likelihood
