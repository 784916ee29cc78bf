"""One-to-one matching by trying all matchings."""

from itertools import combinations


def matchings(generated, original, reach: int):
    """Give every set of pairs within reach in which no closing occurs twice."""
    pairs = [(g, o) for g in generated for o in original if abs(g - o) <= reach]
    for size in range(len(pairs) + 1):
        for chosen in combinations(pairs, size):
            if len({g for g, _ in chosen}) == len({o for _, o in chosen}) == size:
                yield chosen


def nearest_first(generated, original, reach: int) -> tuple[int, ...]:
    """Return how many pairs are 0, 1, … ``reach`` apart, in the matching with most pairs at the least distances."""
    return max(
        tuple(sum(abs(g - o) == distance for g, o in chosen) for distance in range(reach + 1))
        for chosen in matchings(generated, original, reach)
    )
