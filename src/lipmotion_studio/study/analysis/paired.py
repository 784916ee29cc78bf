"""Paired comparisons: preferences with their tests, consistency of both orders, strengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion_studio.study.analysis import crossed
from lipmotion_studio.study.answers import FIRST, Answer

MAX_STEPS = 20_000
SMALLEST_STEP = 1e-12  # iteration ends when no strength changes by a larger share
HALF_WIN = 0.5  # given to both sides of every comparison that was made, in its order, where a strength were infinite


@dataclass(frozen=True, eq=False)
class Strengths:
    """A fitted model: the log odds that i, shown first, is preferred to j are strength i - strength j + order.

    strengths : mean 0 [shape=(C,)]
    order     : of the first of two equal conditions; 0 where no pair was shown in both orders
    covariance : of strengths and order, were all answers independent [shape=(C + 1, C + 1)]
    is_shrunk : whether the likelihood has no maximum, so that half wins were added
    """

    strengths: crossed.Array
    order: float
    covariance: crossed.Array
    is_shrunk: bool


def fit_strengths(first_wins: crossed.Array, second_wins: crossed.Array) -> Strengths:
    """Return the strengths of most likely preferences.

    first_wins, second_wins : how often i, shown first, was preferred to j, and j to it [shape=(C, C)]
    All conditions must be linked by comparisons (``link_groups``).
    Where some condition always wins, or only the place decides, the likelihood grows without end (Albert & Anderson
    1984): then every comparison that was made gets half a win on each side.
    Source: Hunter 2004, §2 and 4 (minorisation and maximisation, effect of the place). Deviation: half wins.
    """
    has_order = bool(((first_wins + second_wins > 0) & (first_wins + second_wins > 0).T).any())
    is_shrunk = not _has_maximum(first_wins, second_wins, has_order)
    if is_shrunk:
        made = HALF_WIN * (first_wins + second_wins > 0)
        first_wins, second_wins = first_wins + made, second_wins + made
    comparisons = first_wins + second_wins
    wins = first_wins.sum(axis=1) + second_wins.sum(axis=0)
    worth, place = np.ones(len(wins)), 1.0
    for _ in range(MAX_STEPS):
        before = np.append(worth, place)
        weight = comparisons / (place * worth[:, None] + worth)
        worth = wins / (place * weight.sum(axis=1) + weight.sum(axis=0))
        worth /= np.exp(np.log(worth).mean())
        if has_order:
            place = first_wins.sum() / (comparisons * worth[:, None] / (place * worth[:, None] + worth)).sum()
        if np.abs(np.append(worth, place) / before - 1).max() < SMALLEST_STEP:
            break
    strengths, order = np.log(worth), float(np.log(place))
    probability = 1 / (1 + np.exp(strengths - strengths[:, None] - order))
    weights = comparisons * probability * (1 - probability)
    pairs = np.argwhere(weights > 0)
    contrasts = _build_contrasts(pairs, len(weights))
    contrasts[:, -1] *= has_order
    information = (contrasts * weights[tuple(pairs.T)][:, None]).T @ contrasts  # Fisher's, on strengths and order
    covariance: crossed.Array = np.linalg.pinv(information, hermitian=True, rcond=1e-10).astype(float)
    return Strengths(strengths, order, covariance, is_shrunk)


def link_groups(comparisons: crossed.Array) -> list[list[int]]:
    """Return the groups of conditions that are linked by comparisons [shape=(C, C)]."""
    from scipy.sparse.csgraph import connected_components

    count, labels = connected_components(comparisons, directed=False)
    return [np.flatnonzero(labels == label).tolist() for label in range(count)]


def _has_maximum(first_wins: crossed.Array, second_wins: crossed.Array, has_order: bool) -> bool:
    """Return whether the likelihood has a maximum: no direction of strengths and order in which it never falls."""
    from scipy.optimize import linprog

    won, lost = (_build_contrasts(np.argwhere(wins > 0), len(wins)) for wins in (first_wins, second_wins))
    contrasts = np.concatenate([won, -lost])
    contrasts[:, -1] *= has_order
    limits = np.zeros(len(contrasts))
    best = linprog(-contrasts.sum(axis=0), A_ub=-contrasts, b_ub=limits, bounds=(-1, 1), method="highs")
    return bool(-best.fun < 1e-7)


def _build_contrasts(pairs: NDArray[np.intp], count: int) -> crossed.Array:
    """Return what the log odds of comparisons are in strengths and order [shape=(N, C + 1)]; ``pairs``: (N, 2)."""
    contrasts = np.zeros((len(pairs), count + 1))
    rows = np.arange(len(pairs))
    contrasts[rows, pairs[:, 0]] = 1
    contrasts[rows, pairs[:, 1]] = -1
    contrasts[:, -1] = 1
    return contrasts


def compute_deviations(model: Strengths, pairs: NDArray[np.intp], is_first: NDArray[np.bool_]) -> crossed.Array:
    """Return by how much each answer moves strengths and order, to first order [shape=(N, C + 1)].

    pairs : what was shown first and second [shape=(N, 2)];  is_first : whether the first was preferred [shape=(N,)]
    Their sum over all answers is 0 at the maximum of the likelihood; how it varies with raters and sentences is how
    sure the strengths are (Liang & Zeger 1986).
    """
    first, second = model.strengths[pairs].T
    expected = 1 / (1 + np.exp(-(first - second + model.order)))
    return (_build_contrasts(pairs, len(model.strengths)) * (is_first - expected)[:, None]) @ model.covariance


Indices = NDArray[np.intp]
Figures = dict[str, Any]
ALL_EQUAL = "raters, all agree"  # what an interval of a share of 0 or 1 is over: each rater counts once


@dataclass(frozen=True, eq=False)
class PairTable:
    """Answers to N paired comparisons: conditions shown first and second [shape=(N, 2)], rater and sentence."""

    conditions: tuple[str, ...]
    raters: tuple[str, ...]
    sentences: tuple[str, ...]
    shown: Indices
    is_first: NDArray[np.bool_]
    rater: Indices
    sentence: Indices

    def average_cells(self, values: crossed.Array, chosen: NDArray[np.bool_]) -> crossed.Array:
        """Return the mean of the chosen answers' values for each rater and sentence [shape=(R, S)]; NaN: no answer."""
        count = self._sum_cells(np.ones(len(values)), chosen)
        return np.where(count > 0, self._sum_cells(values, chosen) / np.maximum(count, 1), np.nan)

    def _sum_cells(self, values: crossed.Array, chosen: NDArray[np.bool_]) -> crossed.Array:
        sums = np.zeros((len(self.raters), len(self.sentences)))
        np.add.at(sums, (self.rater[chosen], self.sentence[chosen]), values[chosen])
        return sums

    def mark_between(self, condition: int, other: int) -> NDArray[np.bool_]:
        """Return which answers compare two conditions, in whatever order [shape=(N,)]."""
        return (self.shown == (condition, other)).all(axis=1) | (self.shown == (other, condition)).all(axis=1)

    def is_preferred(self, condition: int) -> NDArray[np.bool_]:
        """Return which answers prefer a condition [shape=(N,)]."""
        return np.where(self.is_first, self.shown[:, 0], self.shown[:, 1]) == condition

    def count_wins(self) -> crossed.Array:
        """Return how often i, shown first, was preferred to j, and j to it [shape=(2, C, C)]."""
        wins = np.zeros((2, len(self.conditions), len(self.conditions)))
        np.add.at(wins, (1 - self.is_first.astype(int), *self.shown.T), 1)
        return wins


def tabulate_pairs(answers: Sequence[Answer]) -> PairTable:
    """Return the table of answers to paired comparisons. Raises InputError: a condition meets itself, or nothing."""
    for answer in answers:
        if not answer.other or answer.other == answer.condition:
            raise InputError(
                f"rater {answer.rater!r}, trial {answer.trial}: {answer.condition!r} compared with {answer.other!r}, "
                "required two conditions; mark trials that only check attention by the column 'expected'"
            )
    conditions = sorted({name for answer in answers for name in (answer.condition, answer.other)})
    raters, sentences = (sorted({getattr(answer, name) for answer in answers}) for name in ("rater", "sentence"))
    places = [{name: place for place, name in enumerate(names)} for names in (conditions, raters, sentences)]
    return PairTable(
        tuple(conditions),
        tuple(raters),
        tuple(sentences),
        np.array([(places[0][each.condition], places[0][each.other]) for each in answers], np.intp).reshape(-1, 2),
        np.array([each.value == FIRST for each in answers], bool),
        np.array([places[1][each.rater] for each in answers], np.intp),
        np.array([places[2][each.sentence] for each in answers], np.intp),
    )


def analyse_pairs(table: PairTable) -> Figures:
    """Return the figures of paired comparisons."""
    everything = np.full(len(table.is_first), True)
    first = analyse_shares(table.average_cells(table.is_first.astype(float), everything))
    rows = []
    for i, j, cells in _pair_cells(table):
        chosen = table.mark_between(i, j)
        wins, count = int((table.is_preferred(i) & chosen).sum()), int(chosen.sum())
        names: Figures = {"condition": table.conditions[i], "other": table.conditions[j]}
        counts = {"wins": wins, "answers": count, "p_binomial": compute_binomial_p(wins, count)}
        rows.append(names | counts | analyse_shares(cells))
    corrected = crossed.correct_p_values([row["p"] for row in rows])
    scores = []
    for place, name in enumerate(table.conditions):  # how often each was preferred: Hofer 2008, Fig. 6
        chosen, preferred = (table.shown == place).any(axis=1), table.is_preferred(place)
        share = analyse_shares(table.average_cells(preferred.astype(float), chosen))
        counts = {"wins": int((preferred & chosen).sum()), "answers": int(chosen.sum())}
        scores.append({"condition": name} | counts | {key: share[key] for key in ("share", "low", "high")})
    consistent, pairs = compare_orders(table).sum(axis=0).tolist()  # of the pairs that a rater saw in both orders
    return {
        "conditions": scores,
        "pairs": [row | {"p_holm": p} for row, p in zip(rows, corrected, strict=True)],
        "first_preferred": {"answers": len(table.is_first)} | first,
        "consistency": {"pairs": pairs, "consistent": consistent, "share": consistent / pairs if pairs else np.nan},
        "bradley_terry": analyse_strengths(table),
    }


def analyse_shares(cells: crossed.Array) -> Figures:
    """Return a share, its interval over raters and sentences, and the test against one half.

    cells : share of each rater on each sentence; NaN: none [shape=(R, S)]
    The interval is symmetric in log odds. Where all answers agree, it is the exact one of as many independent answers
    as there are raters (Clopper & Pearson 1934), and so is the test.
    """
    share = crossed.estimate_mean(cells, 1.0)
    raters = int(np.isfinite(cells).any(axis=1).sum())
    if share.mean in (0.0, 1.0):
        wins = int(share.mean) * raters
        interval, p, over = compute_exact_interval(wins, raters), compute_binomial_p(wins, raters), ALL_EQUAL
    else:
        interval, p = share.compute_interval_within(0, 1), share.to_log_odds(0, 1).p_value
        over = share.over if share.is_known else crossed.NOTHING
    return {"share": share.mean, "low": interval.low, "high": interval.high, "p": p, "over": over}


def compute_exact_interval(wins: int, count: int) -> crossed.Interval:
    """Return the exact interval of a probability, from independent answers. Source: Clopper & Pearson 1934."""
    from scipy.special import betaincinv

    tail = (1 - crossed.CONFIDENCE) / 2
    low = float(betaincinv(wins, count - wins + 1, tail)) if wins else 0.0
    return crossed.Interval(low, float(betaincinv(wins + 1, count - wins, 1 - tail)) if wins < count else 1.0)


def compute_binomial_p(wins: int, count: int) -> float:
    """Return the exact two-sided p-value of a binomial test against one half."""
    from scipy.special import bdtr

    return min(1.0, float(2 * bdtr(min(wins, count - wins), count, 0.5)))


def compare_orders(table: PairTable) -> Indices:
    """Return for each rater how many pairs were preferred alike in both orders, and of how many [shape=(R, 2)]."""
    counts = np.zeros((len(table.raters), 2), np.intp)
    preferred: dict[tuple[int, int, int, int], bool] = {}
    columns = table.rater, table.sentence, *table.shown.T, table.is_first
    for rater, sentence, first, second, is_first in zip(*(column.tolist() for column in columns), strict=True):
        preferred[rater, sentence, first, second] = is_first
    for (rater, sentence, first, second), is_first in preferred.items():
        turned = preferred.get((rater, sentence, second, first))
        if first < second and turned is not None:
            counts[rater] += (is_first != turned, 1)
    return counts


def analyse_strengths(table: PairTable) -> Figures:
    """Return strengths of all conditions with intervals, and the effect of the order; or why there are none."""
    first, second = table.count_wins()
    groups = link_groups(first + second)
    if len(groups) > 1:
        texts = (", ".join(table.conditions[place] for place in group) for group in groups)
        return {"missing": f"no comparison links the groups {'; '.join(texts)}"}
    model = fit_strengths(first, second)
    deviations = compute_deviations(model, table.shown, table.is_first)
    names = table.conditions

    def make_row(value: float, change: crossed.Array) -> Figures:
        count = table._sum_cells(np.ones(len(change)), np.full(len(change), True))
        sums = table._sum_cells(change, np.full(len(change), True))
        error = crossed.estimate_mean(np.where(count > 0, sums * int((count > 0).sum()), np.nan), 1.0)
        interval = crossed.CrossedMean(value, error.error, error.degrees, error.over, None).interval
        low, high = (np.nan, np.nan) if model.is_shrunk else interval
        return {"strength": value, "low": low, "high": high}

    strengths = model.strengths
    rows = [{"condition": name, **make_row(float(strengths[i]), deviations[:, i])} for i, name in enumerate(names)]
    return {
        "conditions": sorted(rows, key=lambda each: -each["strength"]),
        "pairs": [
            {"condition": names[i], "other": names[j]}
            | make_row(float(strengths[i] - strengths[j]), deviations[:, i] - deviations[:, j])
            for i, j in combinations(range(len(names)), 2)
        ],
        "order": make_row(model.order, deviations[:, -1]),
        "is_shrunk": model.is_shrunk,
    }


def average_share_effects(table: PairTable) -> crossed.Components | None:
    """Return the mean variances of effects on shares, by that of one answer; None: they cannot be told apart."""
    components = []
    for _, _, cells in _pair_cells(table):
        share = crossed.estimate_mean(cells, 1.0)
        if share.components and share.error > 0:
            components.append(np.array(share.components) / (share.mean * (1 - share.mean)))
    return crossed.Components(*np.mean(components, axis=0).tolist()) if components else None


def _pair_cells(table: PairTable) -> list[tuple[int, int, crossed.Array]]:
    """Return all pairs that were compared, and the share of the first for each rater and sentence."""
    cells = []
    for i, j in combinations(range(len(table.conditions)), 2):
        chosen = table.mark_between(i, j)
        if chosen.any():
            cells.append((i, j, table.average_cells(table.is_preferred(i).astype(float), chosen)))
    return cells
