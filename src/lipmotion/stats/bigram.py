"""A back-off bigram language model over units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.schema import ArraySpec

DISCOUNT = 0.5  # subtracted from the count of every pair of units that occurred
BIGRAM = {"bigram": ArraySpec(np.float32, "U U", -1e4, 0.1)}
PERPLEXITY_STEPS = 200  # after so many steps the shares of the units hardly change
ROW_TOLERANCE = 0.01  # largest error of a sum of stored probabilities


@dataclass(frozen=True, eq=False)
class Bigram:
    """A bigram: log P(next | unit) [shape=(V, V)], a row for each unit, a column for each next unit."""

    units: tuple[str, ...]
    log_probability: NDArray[np.float32]

    def __call__(self, unit: str, following: str) -> float:
        """Return log P(following | unit)."""
        return float(self.log_probability[self.units.index(unit), self.units.index(following)])

    @cached_property
    def perplexity(self) -> float:
        """The number of next units among which an equally uncertain choice would be: exp(entropy rate)."""
        move = np.exp(self.log_probability.astype(float))
        move /= move.sum(axis=1, keepdims=True)
        share = np.full(len(move), 1 / len(move))
        for _ in range(PERPLEXITY_STEPS):
            share = (share + share @ move) / 2  # the mean of two steps settles where single ones would alternate
        return float(np.exp(-(share[:, None] * move * np.log(np.maximum(move, np.finfo(float).tiny))).sum()))


def estimate_bigram(units: Sequence[str], sentences: Iterable[Sequence[str]]) -> Bigram:
    """Return the bigram of sentences, by absolute discounting with back-off to unigrams.

    Pairs that occur lose ``DISCOUNT`` of their count; the other pairs of the same unit share what is lost, in
    proportion to P(next), so every row sums to 1. A unit that never occurs has a count of one half.
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
    rows = []
    for row in counts:
        total, occurs = row.sum(), row > 0
        probability = np.where(occurs, (row - DISCOUNT) / total, 0) if total else unigram
        if total and occurs.all():
            probability = probability / probability.sum()
        elif total:
            backed_off = np.where(occurs, 0, unigram) * (1 - probability.sum()) / unigram[~occurs].sum()
            probability = probability + backed_off
        rows.append(probability)
    return Bigram(tuple(units), np.log(rows).astype(np.float32))


def bigram_from_array(units: Sequence[str], stored: NDArray[np.float32]) -> Bigram:
    """Deserialise a bigram, stored as ``BIGRAM``. Raises ValueError: a row whose probabilities do not sum to 1."""
    check_sums_to_one("bigram", np.exp(stored.astype(float)).sum(axis=1))
    return Bigram(tuple(units), stored)


def check_sums_to_one(name: str, totals: NDArray[np.float64]) -> None:
    """Raise ValueError unless all totals, sums of probabilities, are 1; ``name`` is that of the array."""
    worst = float(np.abs(totals - 1).max())
    if worst > ROW_TOLERANCE:
        raise ValueError(f"{name} of probabilities whose sum is {worst:g} off, required 1")
