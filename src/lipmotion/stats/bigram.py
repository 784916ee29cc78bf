"""A back-off bigram over units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.schema import ArraySpec

DISCOUNT = 0.5
BIGRAM = {"bigram": ArraySpec(np.float32, "U U", -1e4, 0.1)}
"""Log probabilities, stored."""
ROW_TOLERANCE = 0.01


@dataclass(frozen=True, eq=False)
class Bigram:
    """Log P(next | unit) [shape=(V, V)], row: unit, column: next."""

    units: tuple[str, ...]
    log_probability: NDArray[np.float32]

    def __call__(self, unit: str, following: str) -> float:
        """Return log P(following | unit)."""
        return float(self.log_probability[self.units.index(unit), self.units.index(following)])


def estimate_bigram(units: Sequence[str], sentences: Iterable[Sequence[str]]) -> Bigram:
    """Estimate by absolute discounting, backing off to unigrams.

    Pairs seen lose ``DISCOUNT`` of their count; what they lose is shared by the unseen pairs of the same
    unit in proportion to P(next), so every row sums to 1. Units never seen count as seen half a time.
    Source: the back-off bigram of Hofer 2008, Eq. 5 (the print names no discount).
    """
    pairs: Counter[tuple[str, str]] = Counter()
    singles: Counter[str] = Counter()
    for sentence in sentences:
        pairs.update(pairwise(sentence))
        singles.update(sentence)
    index = {unit: i for i, unit in enumerate(units)}
    unigram = np.array([singles[unit] or 0.5 for unit in units], float)
    unigram /= unigram.sum()
    counts = np.zeros((len(units), len(units)))
    for (unit, following), count in pairs.items():
        counts[index[unit], index[following]] = count
    return Bigram(tuple(units), np.log([_row(row, unigram) for row in counts]).astype(np.float32))


def bigram_from_array(units: Sequence[str], stored: NDArray[np.float32]) -> Bigram:
    """Return a stored bigram, as ``BIGRAM`` says. Raises ValueError: a row whose probabilities do not sum to 1."""
    check_sums_to_one("bigram", np.exp(stored.astype(float)).sum(axis=1))
    return Bigram(tuple(units), stored)


def check_sums_to_one(name: str, totals: NDArray[np.float64]) -> None:
    """Raise ValueError unless probabilities sum to 1."""
    worst = float(np.abs(totals - 1).max())
    if worst > ROW_TOLERANCE:
        raise ValueError(f"{name} of probabilities whose sum is {worst:g} off, required 1")


def _row(counts: NDArray[np.float64], unigram: NDArray[np.float64]) -> NDArray[np.float64]:
    total, seen = counts.sum(), counts > 0
    if not total:
        return unigram
    row = np.where(seen, (counts - DISCOUNT) / total, 0)
    if seen.all():
        return row / row.sum()
    return row + np.where(seen, 0, unigram) * (1 - row.sum()) / unigram[~seen].sum()
