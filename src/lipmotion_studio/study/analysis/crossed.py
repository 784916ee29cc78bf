"""Means of judgements by several raters of several sentences, with intervals for other raters and sentences.

A judgement is the sum of a mean, an effect of the rater, one of the sentence and a rest (two-way random effects). What
one rater says of six sentences are not six independent judgements, nor are forty raters' words on one sentence forty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion_studio.study.answers import ANCHOR, HIGHEST_MOS, RECORDING, Answer

Array = NDArray[np.float64]
CONFIDENCE = 0.95  # share of studies whose intervals shall cover the truth
ROUNDING = 1e-9  # a standard error below this share of the scale is rounding: all judgements are equal
BOTH, RATERS, SENTENCES, NOTHING = "raters and sentences", "raters", "sentences", "nothing"
"""What an interval generalises over."""


class Components(NamedTuple):
    """Variances of the effects of raters and sentences, and of the rest (of a rater on a sentence)."""

    rater: float
    sentence: float
    residual: float


class Interval(NamedTuple):
    """Limits of an interval; not finite where it is unknown."""

    low: float
    high: float


UNKNOWN = Interval(np.nan, np.nan)


@dataclass(frozen=True)
class CrossedMean:
    """A mean over raters and sentences.

    error      : standard error; 0 where all judgements are equal, which says nothing of those of other raters
    over       : what the error generalises over
    components : variances of the effects; None where they cannot be told apart
    """

    mean: float
    error: float
    degrees: float
    over: str
    components: Components | None

    @property
    def interval(self) -> Interval:
        """The interval of the mean by Student's t; unknown where all judgements are equal, or there is one."""
        from scipy.special import stdtrit

        if not self.is_known:
            return UNKNOWN
        half = float(stdtrit(self.degrees, (1 + CONFIDENCE) / 2)) * self.error
        return Interval(self.mean - half, self.mean + half)

    @property
    def is_known(self) -> bool:
        """Whether there is an error to judge the mean by."""
        return self.over != NOTHING and self.error > 0

    @property
    def p_value(self) -> float:
        """The two-sided probability of a mean so far from 0, were the truth 0; NaN: unknown."""
        from scipy.special import stdtr

        return float(2 * stdtr(self.degrees, -abs(self.mean) / self.error)) if self.is_known else float("nan")

    def to_log_odds(self, low: float, high: float) -> CrossedMean:
        """Return the logarithm of (mean - low) / (high - mean), with its error to first order; low < mean < high."""
        slope = (high - low) / ((self.mean - low) * (high - self.mean))
        odds = float(np.log((self.mean - low) / (high - self.mean)))
        return CrossedMean(odds, self.error * slope, self.degrees, self.over, None)

    def compute_interval_within(self, low: float, high: float) -> Interval:
        """Return the interval that is symmetric in log odds: it leaves no scale, and is right near its ends, too."""
        if not low < self.mean < high:
            return UNKNOWN
        shares = 1 / (1 + np.exp(-np.array(self.to_log_odds(low, high).interval)))
        return Interval(*(low + (high - low) * shares).tolist())


def estimate_mean(values: Array, width: float) -> CrossedMean:
    """Return the mean of a table of judgements, and its standard error for other raters and other sentences.

    values : a row for each rater, a column for each sentence; NaN where there is no judgement [shape=(R, S)]
    width  : of the scale, by which differences are told from rounding
    The variance of the mean is the sum of those of the effects, each estimated by moments and at least 0; degrees of
    freedom by Satterthwaite's approximation, to which an effect that is estimated as 0 does not add. Coverage:
    docs/study-analysis.md. With one rater or sentence, or none that share one, the error is over the others alone.
    Source: Searle, Casella & McCulloch 1992, §4.3 and 5.2 (moments); Gao & Owen 2017 (tables with gaps).
    Deviation: an effect of 0 leaves the degrees of freedom.
    """
    table = values[np.isfinite(values).any(axis=1)][:, np.isfinite(values).any(axis=0)]
    seen = np.isfinite(table)
    cells = int(seen.sum())
    if not cells:
        return CrossedMean(np.nan, np.nan, np.nan, NOTHING, None)
    mean = float(table[seen].mean())
    rest = np.where(seen, table - mean, 0.0)
    raters, sentences = table.shape
    if cells == 1:
        return CrossedMean(mean, np.nan, np.nan, NOTHING, None)

    def compute_error(variance: float) -> float:
        error = float(np.sqrt(variance))
        return error if error > ROUNDING * width else 0.0

    if cells in (raters, sentences):  # a cell for each of one kind: grouped by the other, unless there is one group
        by_rater = sentences == 1 or (raters > 1 and cells == sentences)
        sums = rest.sum(axis=int(by_rater))  # of the differences from the mean in each group
        spread = len(sums) / (len(sums) - 1) * float(np.square(sums).sum()) / cells**2
        over = RATERS if by_rater else SENTENCES
        return CrossedMean(mean, compute_error(spread), len(sums) - 1, over, None)
    components = _estimate_components(rest, seen)
    shares = [float(np.square(seen.sum(axis=axis) / cells).sum()) for axis in (1, 0)]  # 1 / R and 1 / S without gaps
    rater, sentence, residual = np.array(components)[:, None] * np.array([*shares, 1 / cells])[:, None]
    free = 1 / shares[0] - 1, 1 / shares[1] - 1, max(cells - raters - sentences + 1.0, 1.0)
    variance, degrees = combine_variances(rater, sentence, residual, free)
    return CrossedMean(mean, compute_error(variance[0]), float(degrees[0]), BOTH, components)


def combine_variances(
    rater: Array, sentence: Array, rest: Array, free: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Return the variance of a mean and its degrees of freedom, from those of raters, sentences, the rest."""
    variance = rater + sentence + rest
    doubt = np.where(rater > 0, (rater + rest) ** 2 / free[0], 0) + np.where(
        sentence > 0, (sentence + rest) ** 2 / free[1], 0
    )
    doubt = doubt + np.where((rater > 0) == (sentence > 0), rest**2 / free[2], 0)
    return variance, np.divide(variance**2, doubt, out=np.full_like(variance, np.inf), where=doubt > 0)


def _estimate_components(rest: Array, seen: NDArray[np.bool_]) -> Components:
    """Return the variances of effects by three sums of squares; rests are 0 where nothing was judged [shape=(R, S)]."""
    of_rater, of_sentence, cells = seen.sum(axis=1), seen.sum(axis=0), int(seen.sum())
    squares = float(np.square(rest).sum())
    within_raters = squares - float((rest.sum(axis=1) ** 2 / of_rater).sum())
    within_sentences = squares - float((rest.sum(axis=0) ** 2 / of_sentence).sum())
    without_rater = within_raters / (cells - len(of_rater))  # of sentence and rest
    without_sentence = within_sentences / (cells - len(of_sentence))  # of rater and rest
    raters = cells - float(np.square(of_rater).sum()) / cells
    sentences = cells - float(np.square(of_sentence).sum()) / cells
    excess = raters * without_sentence + sentences * without_rater - squares
    residual = max(excess / (raters + sentences - cells + 1), 0.0) if raters + sentences > cells - 1 else 0.0
    return Components(max(without_sentence - residual, 0.0), max(without_rater - residual, 0.0), residual)


def correct_p_values(p_values: list[float]) -> list[float]:
    """Return p-values corrected for their number (Holm 1979); NaN ones stay so, and do not count."""
    ranked = sorted((value, place) for place, value in enumerate(p_values) if not np.isnan(value))
    corrected, floor = list(p_values), 0.0
    for rank, (value, place) in enumerate(ranked):
        floor = max(floor, min(1.0, (len(ranked) - rank) * value))
        corrected[place] = floor
    return corrected


SCALE = 1.0, float(HIGHEST_MOS)  # lowest and highest judgement
WIDTH = SCALE[1] - SCALE[0]
Figures = dict[str, Any]


@dataclass(frozen=True, eq=False)
class RatingTable:
    """Mean judgements on one scale [shape=(C, R, S)], NaN where there is none."""

    conditions: tuple[str, ...]
    values: Array
    count: NDArray[np.intp]

    def select_condition(self, condition: str) -> Array:
        """Return the judgements of a condition [shape=(R, S)]."""
        return self.values[self.conditions.index(condition)]

    def list_pairs(self) -> list[tuple[str, str]]:
        """Return all pairs of conditions without the anchor, in the order of the table."""
        return list(combinations([name for name in self.conditions if name != ANCHOR], 2))

    def compare(self, condition: str, other: str) -> CrossedMean:
        """Return the mean difference of two conditions, of the same rater on the same sentence."""
        return estimate_mean(self.select_condition(condition) - self.select_condition(other), WIDTH)


def tabulate_ratings(answers: Sequence[Answer]) -> RatingTable:
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
    return RatingTable(tuple(conditions), values, count)


def analyse_ratings(table: RatingTable, baseline: str | None) -> Figures:
    """Return means, differences of all pairs, and improvement on a baseline (None: the lowest mean) of one scale."""
    means = []
    for number, name in enumerate(table.conditions):
        values = table.select_condition(name)
        mean, seen = estimate_mean(values, WIDTH), np.isfinite(values)
        row = {
            "condition": name,
            "mean": mean.mean,
            **mean.compute_interval_within(*SCALE)._asdict(),
            "deviation": float(values[seen].std(ddof=1)) if seen.sum() > 1 else np.nan,
            "answers": int(table.count[number].sum()),
            "raters": int(seen.any(axis=1).sum()),
            "sentences": int(seen.any(axis=0).sum()),
            "over": mean.over,
        }
        means.append(row)
    base = baseline
    if baseline not in table.conditions:  # the lowest mean but those of anchor and recording
        names = [name for name in table.conditions if name not in (ANCHOR, RECORDING)]
        base = min(names, key=lambda name: float(np.nanmean(table.select_condition(name))), default=None)
    pairs = table.list_pairs()
    differences = [table.compare(*pair) for pair in pairs]
    p_values = [each.p_value for each in differences]
    return {
        "conditions": sorted(means, key=lambda row: -row["mean"]),
        "baseline": base,
        "relative_improvement": [
            measure_improvement(table, name, base) for name in table.conditions if base and name not in (base, ANCHOR)
        ],
        "pairs": [
            {"condition": pair[0], "other": pair[1], "difference": mean.mean}
            | mean.interval._asdict()
            | {"p": p, "p_holm": corrected, "over": mean.over}
            for pair, mean, p, corrected in zip(pairs, differences, p_values, correct_p_values(p_values), strict=True)
        ],
    }


def measure_improvement(table: RatingTable, condition: str, base: str) -> Figures:
    """Return how many per cent the mean of a condition is above that of another, with the interval.

    Both means are of what the same raters judged in both conditions. The interval is that of the mean of
    100 (y - r b) / B, where y and b are judgements, B is the mean of the other condition, and r the ratio of the means.
    Source: Xie & Liu 2007, Tables 4 and 5 ("%RI").
    """
    values, others = table.select_condition(condition), table.select_condition(base)
    both = np.isfinite(values) & np.isfinite(others)
    row: Figures = {"condition": condition, "percent": np.nan, "low": np.nan, "high": np.nan}
    level = float(others[both].mean()) if both.any() else 0.0
    if not level:  # never compared
        return row
    ratio = float(values[both].mean()) / level
    percent = 100 * (ratio - 1)
    interval = estimate_mean(100 * (values - ratio * others) / level, 100 * WIDTH / level).interval
    return row | {"percent": percent, "low": percent + interval.low, "high": percent + interval.high}


def average_difference_effects(table: RatingTable) -> Components | None:
    """Return the mean variances of the effects on differences over all pairs; None: they cannot be told apart."""
    components = [mean.components for mean in (table.compare(*pair) for pair in table.list_pairs()) if mean.components]
    return Components(*np.mean(components, axis=0).tolist()) if components else None
