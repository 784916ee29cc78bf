"""The cheapest path through a trellis by enumeration of all paths."""

from itertools import pairwise, product


def path_cost(path, start, steps) -> float:
    """Return the cost of a path, which begins in a state before the first step."""
    return float(start[path[0]] + sum(steps[i, j, frame] for frame, (i, j) in enumerate(pairwise(path))))


def cheapest_path(start, steps):
    """Return the cheapest path, without the state before the first step, and its cost."""
    states, _, frames = steps.shape
    paths = product(range(states), repeat=frames + 1)
    cost, path = min((path_cost(path, start, steps), path) for path in paths)
    return list(path[1:]), cost


def arrivals(start, steps):
    """Return the cost of the cheapest path to each last state, frame by frame."""
    for step in steps.transpose(2, 0, 1):
        start = [min(start[i] + step[i, j] for i in range(len(start))) for j in range(len(start))]
    return start
