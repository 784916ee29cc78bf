"""The search: the sequence of units of least total cost, by dynamic programming over the candidates of every phone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.inventory import UnitNumbers

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SelectedUnits:
    """The chosen units.

    units        : one for each phone of the target [shape=(U,)]
    target_costs : of each [shape=(U,)]
    join_costs   : of each with the unit before it; the first is 0 [shape=(U,)]
    """

    units: UnitNumbers
    target_costs: Array
    join_costs: Array

    @property
    def cost(self) -> float:
        """The total cost."""
        return float(self.target_costs.sum() + self.join_costs.sum())


def select(
    costs: Costs,
    target: Target,
    excluded: NDArray[np.bool_] | None = None,
    *,
    given: Mapping[int, int] | None = None,
    prune: bool = True,
) -> SelectedUnits:
    """Return the candidates of least total cost.

    excluded : units that must not be used [shape=(all units,)]
    given    : units that must be used, by the number of their phone in the target
    prune    : leave out candidates that cannot be part of the best sequence, and those beyond the beam
    A candidate whose target cost exceeds the least one of its phone by more than two joins can cost is never the best:
    the one of least target cost in its place would be better. So this does not change the cost of the result. Of the
    others, the beam keeps those of the least target costs: by how much that changes the cost was measured
    (docs/results/selection.md).
    Source: Minnis & Breen 2000, §3.
    """
    given = given or {}
    found = [_candidates(costs, target, number, excluded, given.get(number), prune) for number in range(len(target))]
    total, backward, joins = found[0][1].copy(), [], []
    for number in range(1, len(found)):
        (left, _), (right, right_costs) = found[number - 1], found[number]
        join = costs.join_costs(target, number, left, right)
        sums = total[:, None] + join
        best = sums.argmin(axis=0)
        columns = np.arange(len(right))
        backward.append(best)
        joins.append(join[best, columns])
        total = sums[best, columns] + right_costs
    place = int(total.argmin())
    places = [place]
    for best in reversed(backward):
        places.append(int(best[places[-1]]))
    places.reverse()
    return SelectedUnits(
        np.array([units[n] for (units, _), n in zip(found, places, strict=True)], np.intp),
        np.array([each[n] for (_, each), n in zip(found, places, strict=True)]),
        np.array([0.0, *(join[n] for join, n in zip(joins, places[1:], strict=True))]),
    )


def _candidates(
    costs: Costs, target: Target, number: int, excluded: NDArray[np.bool_] | None, given: int | None, prune: bool
) -> tuple[UnitNumbers, Array]:
    """Return the candidates for one phone, and their target costs. Where all units are excluded, they are allowed."""
    if given is not None:
        units = np.array([given], np.intp)
        return units, costs.target_costs(target, number, units)
    if target.by_sound:
        usable = costs.inventory.usable
        units = np.flatnonzero(usable if excluded is None else usable & ~excluded)
        units = costs.nearest(target, number, units) if prune else units
    else:
        units = costs.candidates(target, number, excluded)
    if not len(units):
        units = costs.candidates(target, number)
    each = costs.target_costs(target, number, units)
    if prune:
        kept = np.flatnonzero(each <= each.min() + 2 * costs.config.most)
        if 0 < costs.config.beam < len(kept):
            kept = np.sort(kept[np.argsort(each[kept], kind="stable")[: costs.config.beam]])
        units, each = units[kept], each[kept]
    return units, each
