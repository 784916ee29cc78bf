"""Paths through networks, chains and trellises by enumeration of all of them: the best, the cheapest, posteriors."""

from itertools import groupby, pairwise, product

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


def posteriors(log_emission, emission, arcs, log_initial, log_final):
    """Return posterior [shape=(T, S)], expected count of each arc (as ``arcs``) and log likelihood (-inf: no path).

    arcs : dict of (source, target) to log probability; what is not in it cannot be
    Sums are of extended precision where the processor has it: log densities of 1e5 cancel to some 1e-13.
    """
    frames, states = len(log_emission), len(emission)
    paths = np.indices((states,) * frames).reshape(frames, -1)  # every sequence of states
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


def arrivals(start, steps):
    """Return the cost of the cheapest path to each last state, frame by frame."""
    for step in steps.transpose(2, 0, 1):
        start = [min(start[i] + step[i, j] for i in range(len(start))) for j in range(len(start))]
    return start


def is_division(found, frames: int, hold: int) -> bool:
    """Return whether segments begin at 0, last ``hold`` frames at least, and differ from their neighbours."""
    starts = [first for first, _ in found]
    longs = [end - start for start, end in pairwise([*starts, frames])]
    return (
        starts[0] == 0
        and min(longs) >= min(hold, frames)
        and all(before[1] != after[1] for before, after in pairwise(found))
    )


def division_cost(found, cost, change: float) -> float:
    """Return the cost of segments, of all changes and frames."""
    ends = [first for first, _ in found[1:]] + [len(cost)]
    inside = sum(cost[first:end, label].sum() for (first, label), end in zip(found, ends, strict=True))
    return float(inside + change * (len(found) - 1))


def best_division(cost, hold: int, change: float):
    """Return the best of all divisions into segments of ``hold`` frames at least, and its cost."""
    frames, labels = cost.shape
    every = []
    for labelling in product(range(labels), repeat=frames):
        found, first = [], 0
        for label, run in groupby(labelling):
            found.append((first, label))
            first += len(list(run))
        if is_division(found, frames, hold):
            every.append((division_cost(found, cost, change), found))
    least, found = min(every)
    return found, least
