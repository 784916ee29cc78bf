"""Closure measures: whether the generated mouth closes when the original mouth does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Curve = NDArray[np.float64]
Frames = NDArray[np.intp]
Clips = Sequence[Curve]
CLOSED_SHARE = 0.10
"""The mouth is closed at openings below this share of the 95th percentile of opening on the training list."""
REACH = 2  # a generated closing matches an original one within this many frames (Hofer 2008, §6)


@dataclass(frozen=True)
class Closures:
    """Closure figures of a set of clips.

    score     : share of original closings with a generated one within ±2 frames (Hofer 2008)
    precision : share of generated closings with an original one within ±2 frames
    f1        : twice the number of matched pairs (``match_closings``) over the number of closings of both sides
    timing_ms : median signed error of matched closings, positive where the generated one is late
    original, generated : numbers of closings
    """

    score: float
    precision: float
    f1: float
    timing_ms: float
    original: int
    generated: int


@dataclass(frozen=True)
class PhoneClosures:
    """Closure figures of the intervals of some phones in which the original mouth closes.

    recall    : share of these intervals in which the generated mouth closes
    intervals : number of these intervals
    false_per_minute, original_per_minute : generated and original closings outside the phones per minute of speech
    """

    recall: float
    intervals: int
    false_per_minute: float
    original_per_minute: float


def find_threshold(openings: Sequence[Curve], share: float = CLOSED_SHARE) -> float:
    """Return the opening below which the mouth is closed, from the openings of the training list."""
    return float(share * np.percentile(np.concatenate(openings), 95))


def find_closings(opening: Curve, threshold: float) -> Frames:
    """Return the frames of all closings; a closing is the first closed frame after an open one."""
    closed = opening < threshold
    return np.nonzero(closed[1:] & ~closed[:-1])[0] + 1


def match_closings(generated: Frames, original: Frames, reach: int = REACH) -> list[tuple[int, int]]:
    """Return pairs of a generated and an original closing within ``reach`` frames: as many as possible, one to one.

    Of all matchings with most pairs, one with the smallest sum of distances; in the order of time. No pair crosses a
    gap of more than ``reach`` frames without closings, so that the parts between such gaps are solved one by one.
    """
    from scipy.optimize import linear_sum_assignment

    frames = np.union1d(generated, original)
    starts = frames[1:][np.diff(frames) > reach]
    parts = zip(*(np.split(side, np.searchsorted(side, starts)) for side in (generated, original)), strict=True)
    pairs = []
    for g, o in parts:
        distance = np.abs(g[:, None] - o)
        worth = np.where(distance <= reach, reach * min(len(g), len(o)) + 1 - distance, 0)
        chosen = zip(*linear_sum_assignment(worth, maximize=True), strict=True)
        pairs += [(int(g[row]), int(o[column])) for row, column in chosen if worth[row, column]]
    return pairs


def count_matches(some: Frames, others: Frames, reach: int = REACH) -> int:
    """Return the number of closings that have any of the others within ``reach`` frames."""
    return int((np.abs(some[:, None] - others) <= reach).any(axis=1).sum())


def measure_closures(generated: Clips, original: Clips, threshold: float, rate_hz: float) -> Closures:
    """Return the closure figures of openings, which are given clip by clip."""
    g_closings = [find_closings(g, threshold) for g in generated]
    o_closings = [find_closings(o, threshold) for o in original]
    both = list(zip(g_closings, o_closings, strict=True))
    g_count, o_count = sum(map(len, g_closings)), sum(map(len, o_closings))
    errors = [g_frame - o_frame for g, o in both for g_frame, o_frame in match_closings(g, o)]
    closed = g_count + o_count
    return Closures(
        score=sum(count_matches(o, g) for g, o in both) / o_count if o_count else float("nan"),
        precision=sum(count_matches(g, o) for g, o in both) / g_count if g_count else float("nan"),
        f1=2 * len(errors) / closed if closed else float("nan"),
        timing_ms=float(np.median(errors)) / rate_hz * 1000 if errors else float("nan"),
        original=o_count,
        generated=g_count,
    )


def measure_phones(
    generated: Clips,
    original: Clips,
    intervals: Sequence[Sequence[tuple[float, float]]],
    speech_s: float,
    threshold: float,
    rate_hz: float,
) -> PhoneClosures:
    """Return how often the mouth closes in given intervals, and outside them.

    intervals : of each clip, start and end in seconds; they are extended by one frame on both sides
    speech_s  : seconds of speech outside the intervals, in all clips
    """
    closed = hit = false = natural = 0
    for g, o, clip in zip(generated, original, intervals, strict=True):
        inside = np.zeros(len(o), bool)
        for start_s, end_s in clip:
            first = max(int(np.ceil(start_s * rate_hz - 1e-6)) - 1, 0)
            stop = min(int(np.floor(end_s * rate_hz + 1e-6)) + 2, len(o))
            inside[first:stop] = True
            if (o[first:stop] < threshold).any():
                closed += 1
                hit += bool((g[first:stop] < threshold).any())
        false += int((~inside[find_closings(g, threshold)]).sum())
        natural += int((~inside[find_closings(o, threshold)]).sum())
    minutes = speech_s / 60
    return PhoneClosures(
        recall=hit / closed if closed else float("nan"),
        intervals=closed,
        false_per_minute=false / minutes if minutes else float("nan"),
        original_per_minute=natural / minutes if minutes else float("nan"),
    )
