"""The cheapest alignment of two sequences, by trying all."""

from collections.abc import Callable, Sequence


def least_cost(found: Sequence[str], wanted: Sequence[str], cost: Callable[[str, str], float], gap: float) -> float:
    """Return the cost of the cheapest alignment: of pairs in order, and a gap for every element without a partner."""
    if not found or not wanted:
        return gap * (len(found) + len(wanted))
    return min(
        cost(found[0], wanted[0]) + least_cost(found[1:], wanted[1:], cost, gap),
        gap + least_cost(found[1:], wanted, cost, gap),
        gap + least_cost(found, wanted[1:], cost, gap),
    )
