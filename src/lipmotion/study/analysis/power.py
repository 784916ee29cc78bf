"""How many raters it takes to tell a difference, from how much raters and sentences of a study differ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lipmotion.study.analysis.crossed import CONFIDENCE, Components, variance_of_mean
from lipmotion.study.answers import MOS

MOST_RATERS = 1000
"""No search goes beyond."""
DIFFERENCES = {MOS: (0.1, 0.2, 0.3, 0.5, 1.0)}
"""Differences of means whose numbers of raters are given; on the scale of rankings, ``RANK_DIFFERENCES``."""
RANK_DIFFERENCES = (2.0, 5.0, 10.0, 20.0)
SHARES = (0.55, 0.6, 0.65, 0.7, 0.75)
"""Preferences whose numbers of raters are given."""
USUAL_POWER = 0.8
DRAWS, SEED = 1000, 0
"""Simulated studies of a size."""
MOST_DEGREES = 1e6
"""Degrees of freedom from which on Student's t is normal."""
Figures = dict[str, Any]


def power_of(components: Components, difference: float, raters: int, sentences: int) -> float:
    """Return the probability that the test of ``crossed_mean`` tells a mean difference from 0, at the 5 % level.

    Every rater judges every sentence; two raters and two sentences at least. Judgements are normal: mean squares are
    then chi-squared, drawn with a fixed seed, and independent of the mean, whose probability is exact for each draw.
    """
    from scipy.special import ndtr, stdtrit

    rater, sentence, rest = components.rater / raters, components.sentence / sentences, components.residual
    rest /= raters * sentences
    if rater + sentence + rest <= 0:
        return 1.0 if difference else 1 - CONFIDENCE
    free = raters - 1, sentences - 1, (raters - 1) * (sentences - 1)
    of_rater, of_sentence, of_rest = np.random.default_rng(SEED).chisquare(free, (DRAWS, 3)).T / np.array(free)[:, None]
    noise = rest * of_rest
    found = [np.maximum((part + rest) * draw - noise, 0) for part, draw in ((rater, of_rater), (sentence, of_sentence))]
    variance, degrees = variance_of_mean(found[0], found[1], noise, free)
    limit = stdtrit(np.minimum(degrees, MOST_DEGREES), (1 + CONFIDENCE) / 2) * np.sqrt(variance)
    truth = np.sqrt(rater + sentence + rest)
    return float((ndtr((difference - limit) / truth) + ndtr((-difference - limit) / truth)).mean())


def raters_needed(components: Components, difference: float, sentences: int, power: float = USUAL_POWER) -> int | None:
    """Return the smallest number of raters that tells a difference with some power.

    None: even ``MOST_RATERS`` do not; then the sentences are too few.
    """
    low, high = 1, 2  # the power grows with the raters; one rater is no panel
    while power_of(components, difference, high, sentences) < power:
        low, high = high, 2 * high
        if low >= MOST_RATERS:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        reached = power_of(components, difference, middle, sentences) >= power
        low, high = (low, middle) if reached else (middle, high)
    return high if high <= MOST_RATERS else None


def rating_power(components: Components | None, kind: str, sentences: int, power: float) -> list[Figures]:
    """Return the raters needed for differences of means of a kind of judgement."""
    if components is None or sentences < 2:
        return []
    differences: Sequence[float] = DIFFERENCES.get(kind, RANK_DIFFERENCES)
    return [{"difference": d, "raters": raters_needed(components, d, sentences, power)} for d in differences]


def share_power(components: Components | None, sentences: int, power: float) -> list[Figures]:
    """Return the raters needed for preferences; ``components``: of ``paired.share_components``."""
    if components is None or sentences < 2:
        return []
    rows = []
    for share in SHARES:
        scaled = Components(*(share * (1 - share) * np.array(components)).tolist())
        rows.append({"share": share, "raters": raters_needed(scaled, share - 0.5, sentences, power)})
    return rows
