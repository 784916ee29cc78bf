"""Laughter in a sound: runs of short, like calls ("ha ha ha"), with breath between them.

Source: J.-A. Bachorowski, M. J. Smoski and M. J. Owren, "The acoustic features of human laughter", Journal of the
Acoustical Society of America 110, 2001 (bouts of calls, four to five a second, of which many are not voiced). Syllables
follow one another as fast; but they differ, and most of them is voiced. Deviations: a regression of five figures of a
run, which we fitted (docs/expression.md), decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import HOP
from lipmotion.speech.features.spectrum import log_bands

Curve = NDArray[np.float64]

APART_FRAMES = (11, 40)
"""Calls of one bout are so far apart, least and most."""
LEAST_CALLS = 4
RISE_DB, LOWEST_DB = 6.0, -35.0
"""A call is so much louder than what is beside it, and its level beside the loudest one is at least the second."""
EDGE_FRAMES = 5
"""A bout begins and ends so many frames beside its first and its last call."""
VOICED_SHARES = (0.15, 0.75)
"""Share of the frames of a bout that is voiced; with less it is a cough, or clicks of tongue or teeth."""
WEIGHTS = (14.8, 0.122, -7.09, -2.93, 3.85, -16.5)
"""The log odds of laughter: the sum of these times likeness, depth, voiced share, voiced gaps, log calls, and 1."""
MIN_PROBABILITY = 0.7


class Bout(NamedTuple):
    """A run of calls.

    first, end  : frames
    calls       : their loudest frames
    levels_db   : the levels there
    probability : that it is laughter, 0 to 1
    """

    first: int
    end: int
    calls: tuple[int, ...]
    levels_db: tuple[float, ...]
    probability: float


def laughter(samples: NDArray[np.float32], level_db: Curve, voiced: NDArray[np.bool_]) -> Iterator[Bout]:
    """Yield the bouts of a recording at 16 kHz that are probably laughter, in order.

    level_db : smoothed level of every frame of 10 ms [shape=(T,)]
    voiced   : whether it is voiced [shape=(T,)]
    """
    for calls in runs_of_calls(level_db):
        figures = figures_of(samples, level_db, voiced, calls)
        if figures is None:
            continue
        probability = float(1 / (1 + np.exp(-np.dot(WEIGHTS, [*figures, 1.0]))))
        if probability >= MIN_PROBABILITY:
            first, end = max(calls[0] - EDGE_FRAMES, 0), min(calls[-1] + EDGE_FRAMES + 1, len(level_db))
            yield Bout(first, end, calls, tuple(level_db[[*calls]].tolist()), probability)


def runs_of_calls(level_db: Curve) -> Iterator[tuple[int, ...]]:
    """Yield the loudest frames of successive calls that are near enough to be of one bout."""
    peaks = risen_peaks(level_db, RISE_DB)
    peaks = peaks[level_db[peaks] >= level_db.max() + LOWEST_DB]
    gaps = np.diff(peaks)
    breaks = np.flatnonzero((gaps < APART_FRAMES[0]) | (gaps > APART_FRAMES[1])) + 1
    for run in np.split(peaks, breaks):
        if len(run) >= LEAST_CALLS:
            yield tuple(run.tolist())


def risen_peaks(curve: Curve, prominence: float) -> NDArray[np.intp]:
    """Return the frames of peaks that are at least so far above the higher of the two levels beside them, ascending.

    Beside a peak the curve falls to its lowest value before the next higher peak, or the end. Equal neighbours are no
    peak. The same as ``scipy.signal.find_peaks``, whose import takes longer than recordings of some minutes.
    """
    peaks = np.flatnonzero((curve[1:-1] > curve[:-2]) & (curve[1:-1] > curve[2:])) + 1
    if not len(peaks):
        return peaks
    lowest, heights = np.minimum.reduceat(curve, [0, *peaks]), curve[peaks]
    before = _fallen_to(heights, lowest[:-1])
    after = _fallen_to(heights[::-1], lowest[:0:-1])[::-1]
    return peaks[heights - np.maximum(before, after) >= prominence]


def _fallen_to(heights: Curve, lowest: Curve) -> Curve:
    """Return how low the curve falls before each peak, back to the one before it that is higher [shape=(P,)].

    lowest : value between the peak before and this one [shape=(P,)]
    """
    found, higher = [], list[tuple[float, float]]()
    for height, least in zip(heights.tolist(), lowest.tolist(), strict=True):
        value = least
        while higher and higher[-1][0] <= height:
            value = min(value, higher.pop()[1])
        found.append(value)
        higher.append((height, value))
    return np.array(found)


def figures_of(
    samples: NDArray[np.float32], level_db: Curve, voiced: NDArray[np.bool_], calls: tuple[int, ...]
) -> tuple[float, ...] | None:
    """Return the figures of a run that ``WEIGHTS`` weigh; None: its voiced share is not that of laughter.

    They are the mean correlation of the spectra of successive calls; how far the level falls between them, in decibels;
    the voiced share; the share of the gaps that are voiced where they are quietest; the log number of calls.
    """
    first, end = max(calls[0] - EDGE_FRAMES, 0), min(calls[-1] + EDGE_FRAMES + 1, len(level_db))
    share = float(voiced[first:end].mean())
    if not VOICED_SHARES[0] <= share <= VOICED_SHARES[1]:
        return None
    quietest = [before + int(level_db[before:after].argmin()) for before, after in pairwise(calls)]
    peaks = level_db[[*calls]]
    depth = float(np.mean(np.minimum(peaks[1:], peaks[:-1]) - level_db[quietest]))
    bands = log_bands(samples[first * HOP : (end - 1) * HOP])
    spectra = bands[np.array(calls) - first].astype(np.float64)
    spectra -= spectra.mean(axis=1, keepdims=True)
    spectra /= np.maximum(np.linalg.norm(spectra, axis=1, keepdims=True), 1e-9)
    likeness = float((spectra[1:] * spectra[:-1]).sum(axis=1).mean())
    return likeness, depth, share, float(voiced[quietest].mean()), float(np.log(len(calls)))
