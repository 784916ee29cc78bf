"""Comparison of systems on the same clips: statistics with bootstrap intervals, and paired differences of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures.closures import clip_closure_counts
from lipmotion.measures.curves import Clips, bootstrap_interval
from lipmotion.stats.curves import varies
from lipmotion_lab.evaluation.held_out import OPENING, ComparedClip, HeldOutRecordings

Array = NDArray[np.float64]
LEAST_DIFFERENCE = 1e-6
"""A smaller difference of correlations, or of lengths in eye distances, is rounding."""


@dataclass(frozen=True, eq=False)
class ClipStatistic:
    """A function ``from_total`` of the sum of each clip's contribution, so that bootstrap samples are cheap."""

    sums: Sequence[Array]
    from_total: Callable[[Array], float]

    @property
    def value(self) -> float:
        """The statistic over all clips."""
        return self._value(self.sums)

    def interval(self, seed: int) -> tuple[float, float]:
        """Return the 95 % bootstrap interval over clips."""
        return bootstrap_interval(lambda own, _: self._value(own), self.sums, self.sums, seed)

    def gain(self, other: ClipStatistic, seed: int) -> tuple[float, float]:
        """Return the paired 95 % bootstrap interval of this statistic minus that of another system."""
        return bootstrap_interval(
            lambda own, others: self._value(own) - other._value(others), self.sums, other.sums, seed
        )

    def _value(self, sums: Sequence[Array]) -> float:
        return self.from_total(np.sum(sums, axis=0))


def correlation_statistic(generated: Clips, original: Clips) -> ClipStatistic:
    """Return the mean over channels of ``curves.pooled_correlation`` of clips [each shape=(T_i, P)]."""
    middle, everything = np.concatenate(original).mean(axis=0), np.concatenate(generated)
    still = ~varies(everything)

    def moments(g: Array, o: Array) -> Array:
        a, b = np.where(still, 0, g - middle), o - middle
        return np.stack([np.full(a.shape[1], float(len(a))), *(x.sum(axis=0) for x in (a, b, a * a, b * b, a * b))])

    def mean_correlation(total: Array) -> float:
        count, a, b, aa, bb, ab = total
        squares = np.maximum(aa - a * a / count, 0) * np.maximum(bb - b * b / count, 0)
        correlations = (ab - a * b / count) / np.where(squares > 0, np.sqrt(squares), np.inf)
        return float(correlations.mean())

    return ClipStatistic([moments(g, o) for g, o in zip(generated, original, strict=True)], mean_correlation)


def distance_statistic(generated: Clips, original: Clips) -> ClipStatistic:
    """Return ``curves.mean_distance`` of clips [each shape=(T_i, P)]."""
    errors = [np.linalg.norm(g - o, axis=1) for g, o in zip(generated, original, strict=True)]
    sums = [np.array([error.sum(), len(error)]) for error in errors]
    return ClipStatistic(sums, lambda total: float(total[0] / total[1]))


def closing_score_statistic(generated: Clips, original: Clips, threshold: float) -> ClipStatistic:
    """Return the share, in %, of original closings found in generated openings; NaN where there are none."""
    hits, count = clip_closure_counts(generated, original, threshold)
    sums = [np.concatenate(pair) for pair in zip(hits, count, strict=True)]
    return ClipStatistic(sums, lambda total: float(100 * total[0] / total[1]) if total[1] else float("nan"))


def opening_curves(recordings: HeldOutRecordings, made: Sequence[ComparedClip]) -> tuple[list[Array], list[Array]]:
    """Return the generated and the original opening of every clip [each shape=(T, 1)]."""
    column = slice(recordings.channels.index(OPENING), recordings.channels.index(OPENING) + 1)
    return [clip.generated[:, column] for clip in made], [clip.original[:, column] for clip in made]


def sign_of_difference(interval: Sequence[float | None]) -> int:
    """Return 1 or -1 for a difference whose interval leaves out 0, by ``LEAST_DIFFERENCE`` for rounding, else 0."""
    low, high = interval
    if low is None or high is None:
        return 0
    return int(low > LEAST_DIFFERENCE) - int(high < -LEAST_DIFFERENCE)


def significance_mark(gain: Sequence[float | None]) -> str:
    """Return ``*`` if the interval of a difference does not contain 0, else an empty text."""
    return "*" if sign_of_difference(gain) else ""
