"""One-to-one matching by trying all matchings."""

from itertools import combinations


def matchings(generated, original, reach: int):
    """Give every set of pairs within reach in which no closing occurs twice."""
    pairs = [(g, o) for g in generated for o in original if abs(g - o) <= reach]
    for size in range(len(pairs) + 1):
        for chosen in combinations(pairs, size):
            if len({g for g, _ in chosen}) == len({o for _, o in chosen}) == size:
                yield chosen


def best(generated, original, reach: int) -> tuple[int, int]:
    """Return the largest number of pairs, and the smallest sum of distances of as many pairs."""
    size, distance = max(
        (len(chosen), -sum(abs(g - o) for g, o in chosen)) for chosen in matchings(generated, original, reach)
    )
    return size, -distance
