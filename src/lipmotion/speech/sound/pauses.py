"""Pauses of a long recording: where its sound is quiet enough for long enough to divide it."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.hmm.loudness import find_sound_runs
from lipmotion.types import Audio

Array = NDArray[np.float64]

STEP_S = 0.01
SMOOTHING_FRAMES = 5  # levels are means of this many frames: shorter dips, as in plosives, are none
BLOCK_S = 30.0
"""The quiet and the loud level are measured around every such block, as rooms and voices change in an hour."""
QUIET_PERCENTILE, LOUD_PERCENTILE = 10, 95
SPEECH_SHARE = 0.35
"""Speech is louder than the quiet level by this share of the distance between the quiet and the loud one, in dB."""
MIN_RANGE_DB = 10.0
"""Where loud and quiet differ by less (music, noise), there are no pauses: all of it counts as speech."""
MIN_PAUSE_S = 0.2  # a shorter silence is part of a word, or of no use to divide at
MIN_SPEECH_S = 0.1  # shorter sounds are clicks
QUIETEST_DB = -100.0


def measure_levels_db(audio: Audio) -> Array:
    """Return the smoothed level of every 10 ms [shape=(floor(duration / 0.01),)], dB of full scale."""
    powers = average_powers(audio.samples, round(STEP_S * audio.rate_hz))
    levels: Array = 10 * np.log10(np.maximum(powers, 10 ** (QUIETEST_DB / 10)))
    return scipy.ndimage.uniform_filter1d(levels, SMOOTHING_FRAMES, mode="nearest") if len(levels) else levels


def average_powers(samples: NDArray[np.float32], size: int) -> Array:
    """Return the mean square of every ``size`` samples [shape=(N // size,)]."""
    frames = samples[: len(samples) // size * size].reshape(-1, size)
    powers: Array = np.einsum("ts,ts->t", frames, frames, dtype=np.float64) / size
    return powers


def list_spans(levels: Array) -> list[tuple[float, float]]:
    """Return start and end of every stretch between two pauses, s.

    levels : of ``measure_levels_db``
    Other sounds that are as loud as speech count as speech.
    """
    size = round(BLOCK_S / STEP_S)
    count = max(1, round(len(levels) / size))
    values = []
    for block in range(count):  # each with half a block on both sides
        middle = (block + 0.5) * len(levels) / count
        part = levels[max(0, round(middle - size)) : round(middle + size)]
        low, high = np.percentile(part, [QUIET_PERCENTILE, LOUD_PERCENTILE]) if part.size else (0.0, 0.0)
        values.append(QUIETEST_DB - 1 if high - low < MIN_RANGE_DB else low + SPEECH_SHARE * (high - low))
    middles = (np.arange(count) + 0.5) * len(levels) / count
    loud = levels > np.interp(np.arange(len(levels)), middles, values)
    runs = find_sound_runs(loud, round(MIN_PAUSE_S / STEP_S))
    return [(first * STEP_S, end * STEP_S) for first, end in runs if (end - first) * STEP_S >= MIN_SPEECH_S]
