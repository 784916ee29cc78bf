"""Contextual matches of Minnis & Breen 2000, §3, for N = 5, by counting the phones that agree one after another."""

from collections.abc import Sequence

ORDERS = {"left": (2, 1, 0, 3, 4), "right": (2, 3, 4, 1, 0), "none": (2, 1, 3, 0, 4)}
"""The places of a window A B C D E in the order in which each bias compares them."""
SIDES = {"left": ((2, 1, 0),), "right": ((2, 3, 4),), "none": ((2, 1, 0), (2, 3, 4))}
"""What a match of each bias is a match of: the context on the left, on the right, or on both sides alike."""


def agreement(one: Sequence[object], other: Sequence[object], places: Sequence[int]) -> int:
    """Return how many phones agree from the first place on."""
    count = 0
    for place in places:
        if one[place] != other[place]:
            break
        count += 1
    return count


def matches(wanted: Sequence[object], units: Sequence[Sequence[object]]) -> set[int]:
    """Return every unit that is a match of a bias: none agrees longer on its side, or on both of its sides.

    Without a neighbour that agrees there is no match; where no bias has one, every unit of the phone is.
    """
    found: set[int] = set()
    for sides in SIDES.values():
        lengths = [min(agreement(wanted, unit, places) for places in sides) for unit in units]
        found |= {number for number, length in enumerate(lengths) if length == max(lengths) > 1}
    return found or {number for number, unit in enumerate(units) if unit[2] == wanted[2]}


def longest(wanted: Sequence[object], units: Sequence[Sequence[object]], count: int) -> tuple[set[int], set[int]]:
    """Return the units that ``count`` of each bias must have, and those that they may have, among equally long ones."""
    must, may = set[int](), set[int]()
    for places in ORDERS.values():
        lengths = [agreement(wanted, unit, places) for unit in units]
        least = max(sorted(lengths, reverse=True)[:count][-1], 1)
        may |= {number for number, length in enumerate(lengths) if length >= least}
        better = {number for number, length in enumerate(lengths) if length > least}
        fits = lengths.count(least) + len(better) <= count
        must |= {number for number, length in enumerate(lengths) if length >= least} if fits else better
    return must, may
