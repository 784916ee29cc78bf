"""Systems on the same clips: intervals of a figure, and of what it is more than that of another system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures.bootstrap import interval
from lipmotion.measures.closures import found_closings
from lipmotion.measures.curves import Clips
from lipmotion.pipeline.evaluation.evaluate import OPENING, Clip, Recorded
from lipmotion.stats.rounding import varies

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tally:
    """A figure that follows from sums over clips, so that clips can be drawn thousands of times.

    sums : what each clip adds [all of one shape]
    of   : the figure, from the total
    """

    sums: Sequence[Array]
    of: Callable[[Array], float]

    @property
    def value(self) -> float:
        """The figure over all clips."""
        return self._of(self.sums)

    def interval(self, seed: int) -> tuple[float, float]:
        """Return the 95 % bootstrap interval over clips."""
        return interval(lambda own, _: self._of(own), self.sums, self.sums, seed)

    def gain(self, other: Tally, seed: int) -> tuple[float, float]:
        """Return the paired interval of how much more it is than the same figure of another system."""
        return interval(lambda own, its: self._of(own) - other._of(its), self.sums, other.sums, seed)

    def _of(self, sums: Sequence[Array]) -> float:
        return self.of(np.sum(sums, axis=0))


def correlation_tally(generated: Clips, original: Clips) -> Tally:
    """Return the mean over channels of ``curves.pooled_correlation`` of clips [each shape=(T_i, P)]."""
    middle, everything = np.concatenate(original).mean(axis=0), np.concatenate(generated)
    still = ~varies(everything)

    def moments(g: Array, o: Array) -> Array:
        a, b = np.where(still, 0, g - middle), o - middle
        return np.stack([np.full(a.shape[1], float(len(a))), *(x.sum(axis=0) for x in (a, b, a * a, b * b, a * b))])

    return Tally([moments(g, o) for g, o in zip(generated, original, strict=True)], _mean_correlation)


def distance_tally(generated: Clips, original: Clips) -> Tally:
    """Return ``curves.mean_distance`` of clips [each shape=(T_i, P)]."""
    errors = [np.linalg.norm(g - o, axis=1) for g, o in zip(generated, original, strict=True)]
    return Tally([np.array([error.sum(), len(error)]) for error in errors], lambda total: float(total[0] / total[1]))


def score_tally(generated: Clips, original: Clips, threshold: float) -> Tally:
    """Return the closure score in % of openings [each shape=(T_i, 1)]; NaN where nothing closes."""
    hits, count = found_closings(generated, original, threshold)
    sums = [np.concatenate(pair) for pair in zip(hits, count, strict=True)]
    return Tally(sums, lambda total: float(100 * total[0] / total[1]) if total[1] else float("nan"))


def openings_of(found: Recorded, made: Sequence[Clip]) -> tuple[list[Array], list[Array]]:
    """Return the generated and the recorded opening of every clip [each shape=(T, 1)]."""
    column = slice(found.channels.index(OPENING), found.channels.index(OPENING) + 1)
    return [clip.generated[:, column] for clip in made], [clip.original[:, column] for clip in made]


def mark(gain: Sequence[float | None]) -> str:
    """Return a star where the interval of a difference leaves out 0."""
    low, high = gain
    return "*" if low is not None and high is not None and (low > 0 or high < 0) else ""


def _mean_correlation(total: Array) -> float:
    count, a, b, aa, bb, ab = total
    squares = np.maximum(aa - a * a / count, 0) * np.maximum(bb - b * b / count, 0)
    found = (ab - a * b / count) / np.where(squares > 0, np.sqrt(squares), np.inf)
    return float(found.mean())
