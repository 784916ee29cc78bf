"""The best path through a network by enumeration of all paths."""

from itertools import pairwise, product

import numpy as np


def path_score(path, log_emission, emission, arcs, log_initial, log_final) -> float:
    """Return the log probability of one path.

    arcs : log probability by (source, target); other arcs are impossible
    """
    score = log_initial[path[0]] + log_final[path[-1]]
    score += sum(log_emission[frame, emission[state]] for frame, state in enumerate(path))
    return score + sum(arcs.get(step, -np.inf) for step in pairwise(path))


def best_path(log_emission, emission, arcs, log_initial, log_final):
    """Return the best path of all, and its score (-inf: none is possible)."""
    paths = product(range(len(emission)), repeat=len(log_emission))
    scored = ((path_score(path, log_emission, emission, arcs, log_initial, log_final), path) for path in paths)
    score, path = max(scored)
    return path, score
