"""Recognition by trying every unit sequence with every segmentation."""

from itertools import combinations, pairwise, product
from typing import Any


def segmentations(frames: int, states: int):
    """Give the durations of every division of frames into ``states`` runs, none empty."""
    for cuts in combinations(range(1, frames), states - 1):
        edges = (0, *cuts, frames)
        yield tuple(stop - start for start, stop in pairwise(edges))


def sequences(inventory, counts: dict[str, int], frames: int):
    """Give every sequence of units that fits into the frames."""
    for length in range(1, frames // min(counts.values()) + 1):
        for units in product(inventory, repeat=length):
            if sum(counts[unit] for unit in units) <= frames:
                yield units


def price(hmm, units, silence: str) -> float:
    """Return the log probability of a sequence of units.

    Silence precedes and follows the recording. Every unit has its bigram once, given the one before it; where the
    recording begins in silence, that silence has the insertion penalty only; where it ends in another unit, the
    score of the silence after it is added.
    """
    weight, insertion = hmm.config.bigram_weight, hmm.config.insertion
    pairs = list(pairwise((silence, *units, silence)))
    priced = pairs[units[0] == silence : len(pairs) - (units[-1] == silence)]
    first = insertion if units[0] == silence else 0.0
    return float(first + sum(weight * hmm.bigram(unit, following) + insertion for unit, following in priced))


def score(hmm, features, units, durations, silence: str = "sil") -> float:
    """Return the log probability of units whose states last ``durations`` frames."""
    total = price(hmm, units, silence)
    neighbours = (silence, *units, silence)
    frame, lasting = 0, iter(durations)
    for position, unit in enumerate(units):
        for state in range(hmm.table.count(unit)):
            neighbour = neighbours[position + (2 if hmm.table.side(unit, state) == ">" else 0)]
            density, count = hmm.table.density(unit, state, neighbour), next(lasting)
            total += float(hmm.mixtures.log_likelihood(features[frame : frame + count])[:, density].sum())
            total += (count - 1) * hmm.stay(unit, state) + hmm.move(unit, state)
            frame += count
    return total


def boundaries(hmm, units, durations) -> list[int]:
    """Return the first frame of each unit, and the frame count at the end."""
    edges, frame, lasting = [0], 0, iter(durations)
    for unit in units:
        frame += sum(next(lasting) for _ in range(hmm.table.count(unit)))
        edges.append(frame)
    return edges


def best(hmm, features, candidates, silence: str = "sil"):
    """Return the best of some unit sequences, its bounds and its score (None, None, -inf: none fits)."""
    found: tuple[Any, Any, float] = (None, None, float("-inf"))
    for units in candidates:
        for durations in segmentations(len(features), sum(hmm.table.count(unit) for unit in units)):
            total = score(hmm, features, units, durations, silence)
            if total > found[2]:
                found = (units, boundaries(hmm, units, durations), total)
    return found
