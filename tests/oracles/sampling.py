"""The posterior of whole paths through a network, by enumeration."""

from itertools import product

import numpy as np

from oracles.paths import path_score


def path_posterior(log_emission, emission, arcs, log_initial, log_final):
    """Return the posterior of every possible path, and the log likelihood."""
    paths = list(product(range(len(emission)), repeat=len(log_emission)))
    scores = np.array([path_score(p, log_emission, emission, arcs, log_initial, log_final) for p in paths])
    total = np.logaddexp.reduce(scores)
    return {p: float(np.exp(s - total)) for p, s in zip(paths, scores, strict=True) if np.isfinite(s)}, float(total)
