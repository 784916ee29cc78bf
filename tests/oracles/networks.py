"""Posteriors of networks by enumeration of all state paths."""

from itertools import pairwise

import numpy as np


def every_path(states, frames):
    """Return every sequence of states [shape=(T, S^T)]."""
    return np.indices((states,) * frames).reshape(frames, -1)


def posteriors(log_emission, emission, arcs, log_initial, log_final):
    """Return posterior [shape=(T, S)], expected count of each arc (as ``arcs``) and log likelihood (-inf: no path).

    arcs : dict of (source, target) to log probability; what is not in it cannot be
    Sums are of extended precision where the processor has it: log densities of 1e5 cancel to some 1e-13.
    """
    frames, states = len(log_emission), len(emission)
    paths = every_path(states, frames)
    arc_log = np.full((states, states), -np.inf, np.longdouble)
    for arc, log in arcs.items():
        arc_log[arc] = log
    scores = np.asarray(log_initial, np.longdouble)[paths[0]] + np.asarray(log_final, np.longdouble)[paths[-1]]
    for row, states_then in zip(np.asarray(log_emission, np.longdouble), paths, strict=True):
        scores += row[emission][states_then]
    for before, after in pairwise(paths):
        scores += arc_log[before, after]
    posterior, counts = np.zeros((frames, states)), np.zeros(states * states)
    best = scores.max()
    if np.isneginf(best):
        return posterior, dict.fromkeys(arcs, 0.0), -np.inf
    weights = np.exp(scores - best)
    log_likelihood = best + np.log(weights.sum())
    weights = (weights / weights.sum()).astype(float)
    for frame, states_then in enumerate(paths):
        posterior[frame] = np.bincount(states_then, weights, states)
    for before, after in pairwise(paths):
        counts += np.bincount(before * states + after, weights, states * states)
    return posterior, {(a, b): counts[a * states + b] for a, b in arcs}, float(log_likelihood)
