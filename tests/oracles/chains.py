"""Left-to-right chains by enumeration of all state paths."""

from itertools import pairwise, product

import numpy as np


def chain_paths(frames: int, states: int):
    """Give every path that starts in the first state, ends in the last, and never skips or goes back."""
    for path in product(range(states), repeat=frames):
        steps = [after - before for before, after in pairwise(path)]
        if path[0] == 0 and path[-1] == states - 1 and set(steps) <= {0, 1}:
            yield path


def path_log_probability(path, log_emission, log_stay, log_move) -> float:
    """Return the log probability of one path and its emissions, with that of leaving the chain at its end."""
    total = sum(log_emission[frame, state] for frame, state in enumerate(path))
    total += sum(log_stay[before] if after == before else log_move[before] for before, after in pairwise(path))
    return total + log_move[path[-1]]


def chain_posteriors(log_emission, log_stay, log_move):
    """Return posterior [shape=(T, S)], expected stays [shape=(S,)] and log likelihood (-inf: no path)."""
    frames, states = log_emission.shape
    paths = list(chain_paths(frames, states))
    posterior, stay = np.zeros((frames, states)), np.zeros(states)
    scores = np.array([path_log_probability(path, log_emission, log_stay, log_move) for path in paths])
    log_likelihood = np.logaddexp.reduce(scores, initial=-np.inf)
    if np.isneginf(log_likelihood):
        return posterior, stay, -np.inf
    for path, weight in zip(paths, np.exp(scores - log_likelihood), strict=True):
        for frame, state in enumerate(path):
            posterior[frame, state] += weight
        for before, after in pairwise(path):
            stay[before] += weight * (before == after)
    return posterior, stay, log_likelihood
