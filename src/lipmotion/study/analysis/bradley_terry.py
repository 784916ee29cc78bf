"""Strengths of conditions from paired comparisons: the Bradley–Terry model with an effect of the order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_STEPS = 20_000
SMALLEST_STEP = 1e-12
"""Iteration ends when no strength changes by a larger share."""
HALF_WIN = 0.5
"""Given to both sides of every comparison that was made, in its order, where a strength were infinite."""


@dataclass(frozen=True, eq=False)
class Strengths:
    """A fitted model: the log odds that i, shown first, is preferred to j are strength i - strength j + order.

    strengths : mean 0 [shape=(C,)]
    order     : of the first of two equal conditions; 0 where no pair was shown in both orders
    covariance : of strengths and order, were all answers independent [shape=(C + 1, C + 1)]
    is_shrunk : whether the likelihood has no maximum, so that half wins were added
    """

    strengths: Array
    order: float
    covariance: Array
    is_shrunk: bool

    def probability(self) -> Array:
        """Return the probability that i, shown first, is preferred to j [shape=(C, C)]."""
        return _logistic(self.strengths[:, None] - self.strengths + self.order)


def fit_strengths(first_wins: Array, second_wins: Array) -> Strengths:
    """Return the strengths of most likely preferences.

    first_wins, second_wins : how often i, shown first, was preferred to j, and j to it [shape=(C, C)]
    All conditions must be linked by comparisons (``linked``).
    Where some condition always wins, or only the place decides, the likelihood grows without end (Albert & Anderson
    1984): then every comparison that was made gets half a win on each side.
    Source: Hunter 2004, §2 and 4 (minorisation and maximisation, effect of the place). Deviation: half wins.
    """
    has_order = bool(((first_wins + second_wins > 0) & (first_wins + second_wins > 0).T).any())
    is_shrunk = not _has_maximum(first_wins, second_wins, has_order)
    if is_shrunk:
        made = HALF_WIN * (first_wins + second_wins > 0)
        first_wins, second_wins = first_wins + made, second_wins + made
    strengths, order = _maximised(first_wins, second_wins, has_order)
    probability = _logistic(strengths[:, None] - strengths + order)
    weights = (first_wins + second_wins) * probability * (1 - probability)
    covariance: Array = np.linalg.pinv(_information(weights, has_order), hermitian=True, rcond=1e-10).astype(float)
    return Strengths(strengths, order, covariance, is_shrunk)


def linked(comparisons: Array) -> list[list[int]]:
    """Return the groups of conditions that are linked by comparisons.

    comparisons : how often i was compared with j, in this order [shape=(C, C)]
    """
    from scipy.sparse.csgraph import connected_components

    count, labels = connected_components(comparisons, directed=False)
    return [np.flatnonzero(labels == label).tolist() for label in range(count)]


def _maximised(first_wins: Array, second_wins: Array, has_order: bool) -> tuple[Array, float]:
    """Return log strengths, mean 0 [shape=(C,)], and the effect of the order."""
    comparisons = first_wins + second_wins
    wins = first_wins.sum(axis=1) + second_wins.sum(axis=0)
    worth, place = np.ones(len(wins)), 1.0
    for _ in range(MOST_STEPS):
        before = np.append(worth, place)
        weight = comparisons / (place * worth[:, None] + worth)
        worth = wins / (place * weight.sum(axis=1) + weight.sum(axis=0))
        worth /= np.exp(np.log(worth).mean())
        if has_order:
            place = first_wins.sum() / (comparisons * worth[:, None] / (place * worth[:, None] + worth)).sum()
        if np.abs(np.append(worth, place) / before - 1).max() < SMALLEST_STEP:
            break
    return np.log(worth), float(np.log(place))


def _has_maximum(first_wins: Array, second_wins: Array, has_order: bool) -> bool:
    """Return whether the likelihood has a maximum: no direction of strengths and order in which it never falls."""
    from scipy.optimize import linprog

    rows = _contrasts(np.argwhere(first_wins > 0), len(first_wins)).tolist()
    rows += (-_contrasts(np.argwhere(second_wins > 0), len(first_wins))).tolist()
    contrasts = np.array(rows)
    contrasts[:, -1] *= has_order
    found = linprog(-contrasts.sum(axis=0), A_ub=-contrasts, b_ub=np.zeros(len(rows)), bounds=(-1, 1), method="highs")
    return bool(-found.fun < 1e-7)


def _contrasts(pairs: NDArray[np.intp], count: int) -> Array:
    """Return what the log odds of comparisons are in strengths and order [shape=(N, C + 1)]; ``pairs``: (N, 2)."""
    contrasts = np.zeros((len(pairs), count + 1))
    rows = np.arange(len(pairs))
    contrasts[rows, pairs[:, 0]] = 1
    contrasts[rows, pairs[:, 1]] = -1
    contrasts[:, -1] = 1
    return contrasts


def _information(weights: Array, has_order: bool) -> Array:
    """Return Fisher's information on strengths and order [shape=(C + 1, C + 1)]; ``weights``: of each pair (C, C)."""
    pairs = np.argwhere(weights > 0)
    contrasts = _contrasts(pairs, len(weights))
    contrasts[:, -1] *= has_order
    return (contrasts * weights[tuple(pairs.T)][:, None]).T @ contrasts


def deviations(model: Strengths, pairs: NDArray[np.intp], is_first: NDArray[np.bool_]) -> Array:
    """Return by how much each answer moves strengths and order, to first order [shape=(N, C + 1)].

    pairs : what was shown first and second [shape=(N, 2)];  is_first : whether the first was preferred [shape=(N,)]
    Their sum over all answers is 0 at the maximum of the likelihood; how it varies with raters and sentences is how
    sure the strengths are (Liang & Zeger 1986).
    """
    expected = model.probability()[pairs[:, 0], pairs[:, 1]]
    return (_contrasts(pairs, len(model.strengths)) * (is_first - expected)[:, None]) @ model.covariance


def group_text(names: Sequence[str], groups: Sequence[Sequence[int]]) -> str:
    """Return groups of conditions in words."""
    return "; ".join(", ".join(names[place] for place in group) for group in groups)


def _logistic(values: Array) -> Array:
    return 1 / (1 + np.exp(-values))
