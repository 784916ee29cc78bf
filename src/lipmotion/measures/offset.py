"""Offset of sound and video, estimated from two curves that should be synchronous."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.measures.curves import correlation

Array = NDArray[np.float64]

MIN_SCORE = 0.5
"""Least correlation at which the offset of one clip is known."""
MIN_MARGIN = 0.15
"""Least difference between the best and the second maximum at which an offset is known."""
MIN_CLIPS, WIDEST_S = 5, 0.06
"""An offset of so many clips together is known at any correlation if its interval is as narrow: curves of a voice that
the prediction has not learned correlate less, and agree on the offset all the same (docs/robustness.md)."""
PEAK_S = 0.12
"""Maxima further from the best than this, in seconds, are other ones."""
MIN_SHARE = 0.5
"""Least share of the frames that can be compared at a shift."""
DRAWS = 500
"""Bootstrap samples of an interval."""


@dataclass(frozen=True)
class Offset:
    """Offset of the sound from the video.

    late_s : seconds by which the sound is late; negative: early
    score  : correlation of the two curves at this offset
    margin : difference to the highest correlation further than ``PEAK_S`` away
    low_s, high_s : 95 % interval where several clips were pooled, else both ``late_s``
    clips  : how many clips were pooled
    """

    late_s: float
    score: float
    margin: float
    low_s: float
    high_s: float
    clips: int = 1

    @property
    def known(self) -> bool:
        """Whether the correlation has one maximum only, and is high enough or agreed on by enough clips."""
        agreed = self.clips >= MIN_CLIPS and self.high_s - self.low_s <= WIDEST_S
        return self.margin > MIN_MARGIN and (self.score > MIN_SCORE or agreed)


def shift_scores(predicted: Array, measured: Array, valid: NDArray[np.bool_], reach: int) -> Array:
    """Return the correlation of predicted[t + k] with measured[t] for k = -reach … reach [shape=(2·reach + 1,)].

    predicted, measured : curves [shape=(T,)] at one rate;  valid : where ``measured`` is known [shape=(T,)]
    It is 0 where too few frames overlap, or one curve is constant.
    """
    scores = np.zeros(2 * reach + 1)
    for shift in range(-reach, reach + 1):
        count, first = min(len(predicted) - shift, len(measured)), max(-shift, 0)
        compared = valid[first : max(count, first)]
        if compared.sum() >= max(MIN_SHARE * len(measured), 2):
            a, b = predicted[first + shift : count + shift][compared], measured[first:count][compared]
            scores[shift + reach] = correlation(a[:, None], b[:, None])[0]
    return scores


def best_offset(scores: Array, rate_hz: float) -> Offset:
    """Return the offset of the highest score [shape=(2·reach + 1,)], refined by a parabola."""
    late_s, score, margin = _find_highest(scores, rate_hz)
    return Offset(late_s, score, margin, late_s, late_s)


def pooled_offset(scores: Sequence[Array], rate_hz: float, seed: int = 0) -> Offset:
    """Return the common offset of clips: that of the highest mean score, with a bootstrap interval over clips."""
    clips = np.stack(scores)
    late_s, score, margin = _find_highest(clips.mean(axis=0), rate_hz)
    draw = np.random.default_rng(seed)
    draws = [
        _find_highest(clips[draw.integers(len(clips), size=len(clips))].mean(axis=0), rate_hz)[0] for _ in range(DRAWS)
    ]
    low_s, high_s = np.percentile(draws, [2.5, 97.5])
    return Offset(late_s, score, margin, float(low_s), float(high_s), len(clips))


def _find_highest(scores: Array, rate_hz: float) -> tuple[float, float, float]:
    """Return offset in seconds, score and margin of the highest score (see ``Offset``)."""
    best = int(np.clip(scores.argmax(), 1, len(scores) - 2))
    before, peak, after = scores[best - 1 : best + 2]
    curvature = before - 2 * peak + after
    position = best + (0.5 * (before - after) / curvature if curvature < 0 else 0.0)
    elsewhere = np.abs(np.arange(len(scores)) - position) > PEAK_S * rate_hz
    return (position - len(scores) // 2) / rate_hz, float(peak), float(peak - scores[elsewhere].max(initial=-1.0))
