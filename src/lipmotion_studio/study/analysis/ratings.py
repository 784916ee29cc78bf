"""Opinion scores and rankings: means, differences between conditions, relative improvement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion_studio.study.analysis.crossed import Array, Components, CrossedMean, crossed_mean, holm
from lipmotion_studio.study.answers import ANCHOR, HIGHEST_MOS, HIGHEST_RANK, MOS, RECORDING, Answer

SCALES = {MOS: (1.0, float(HIGHEST_MOS))}
"""Lowest and highest value of each kind of judgement; of the others, ``RANKS``."""
RANKS = (0.0, float(HIGHEST_RANK))
Figures = dict[str, Any]


@dataclass(frozen=True, eq=False)
class RatingTable:
    """Mean judgements on one scale [shape=(C, R, S)], NaN where there is none, and the scale's ends."""

    conditions: tuple[str, ...]
    values: Array
    count: NDArray[np.intp]
    scale: tuple[float, float]

    @property
    def width(self) -> float:
        """How far apart the ends of the scale are."""
        return self.scale[1] - self.scale[0]

    def of(self, condition: str) -> Array:
        """Return the judgements of a condition [shape=(R, S)]."""
        return self.values[self.conditions.index(condition)]

    def compared(self) -> list[tuple[str, str]]:
        """Return all pairs of conditions without the anchor, in the order of the table."""
        return list(combinations([name for name in self.conditions if name != ANCHOR], 2))

    def difference(self, condition: str, other: str) -> CrossedMean:
        """Return the mean difference of two conditions, of the same rater on the same sentence."""
        return crossed_mean(self.of(condition) - self.of(other), self.width)


def rating_table(answers: Sequence[Answer]) -> RatingTable:
    """Return the table of judgements of one kind on one scale; conditions are in alphabetical order."""
    conditions, raters, sentences = (
        sorted({getattr(answer, name) for answer in answers}) for name in ("condition", "rater", "sentence")
    )
    places = [{name: place for place, name in enumerate(names)} for names in (conditions, raters, sentences)]
    totals = np.zeros(tuple(map(len, places)))
    count = np.zeros(totals.shape, np.intp)
    for answer in answers:
        place = places[0][answer.condition], places[1][answer.rater], places[2][answer.sentence]
        totals[place] += int(answer.value)
        count[place] += 1
    values = np.where(count > 0, totals / np.maximum(count, 1), np.nan)
    return RatingTable(tuple(conditions), values, count, SCALES.get(answers[0].kind, RANKS))


def rating_figures(table: RatingTable, baseline: str | None) -> Figures:
    """Return means, differences of all pairs, and improvement on a baseline (None: the lowest mean) of one scale."""
    means = []
    for number, name in enumerate(table.conditions):
        values = table.of(name)
        mean, seen = crossed_mean(values, table.width), np.isfinite(values)
        row = {
            "condition": name,
            "mean": mean.mean,
            **mean.interval_within(*table.scale)._asdict(),
            "deviation": float(values[seen].std(ddof=1)) if seen.sum() > 1 else np.nan,
            "answers": int(table.count[number].sum()),
            "raters": int(seen.any(axis=1).sum()),
            "sentences": int(seen.any(axis=0).sum()),
            "over": mean.over,
        }
        means.append(row)
    base = baseline if baseline in table.conditions else lowest(table)
    pairs = table.compared()
    differences = [table.difference(*pair) for pair in pairs]
    p_values = [each.p_value for each in differences]
    return {
        "conditions": sorted(means, key=lambda row: -row["mean"]),
        "baseline": base,
        "relative_improvement": [
            relative_improvement(table, name, base) for name in table.conditions if base and name not in (base, ANCHOR)
        ],
        "pairs": [
            {"condition": pair[0], "other": pair[1], "difference": mean.mean}
            | mean.interval._asdict()
            | {"p": p, "p_holm": corrected, "over": mean.over}
            for pair, mean, p, corrected in zip(pairs, differences, p_values, holm(p_values), strict=True)
        ],
    }


def lowest(table: RatingTable) -> str | None:
    """Return the condition with the lowest mean but anchor and recording; None: there is no other."""
    names = [name for name in table.conditions if name not in (ANCHOR, RECORDING)]
    return min(names, key=lambda name: float(np.nanmean(table.of(name))), default=None)


def relative_improvement(table: RatingTable, condition: str, base: str) -> Figures:
    """Return how many per cent the mean of a condition is above that of another, with the interval.

    Both means are of what the same raters judged in both conditions. The interval is that of the mean of
    100 (y - r b) / B, where y and b are judgements, B is the mean of the other condition, and r the ratio of the means.
    Source: Xie & Liu 2007, Tables 4 and 5 ("%RI").
    """
    values, others = table.of(condition), table.of(base)
    both = np.isfinite(values) & np.isfinite(others)
    row: Figures = {"condition": condition, "percent": np.nan, "low": np.nan, "high": np.nan}
    level = float(others[both].mean()) if both.any() else 0.0
    if level <= 0:  # never compared; or a baseline of 0 on the scale of rankings
        return row
    ratio = float(values[both].mean()) / level
    percent = 100 * (ratio - 1)
    interval = crossed_mean(100 * (values - ratio * others) / level, 100 * table.width / level).interval
    return row | {"percent": percent, "low": percent + interval.low, "high": percent + interval.high}


def difference_components(table: RatingTable) -> Components | None:
    """Return the mean variances of the effects on differences over all pairs; None: they cannot be told apart."""
    found = [mean.components for mean in (table.difference(*pair) for pair in table.compared()) if mean.components]
    return Components(*np.mean(found, axis=0).tolist()) if found else None
