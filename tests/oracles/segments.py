"""The cheapest division into segments by enumeration of all labellings."""

from itertools import groupby, pairwise, product


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
