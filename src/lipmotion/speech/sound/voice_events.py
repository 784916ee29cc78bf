"""Voice events: what a sound says beside words: laughter, and breaths in pauses.

Everything but where phones are follows from the sound. Rules are strict: a false event is worse than a missed one.

Source of the breaths: D. Ruinskiy and Y. Lavner, "An effective algorithm for automatic detection and exact demarcation
of breath sounds in speech and song signals", IEEE Transactions on Audio, Speech and Language Processing 15, 2007. The
limits are ours, chosen on recordings (docs/expression.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP, find_centres, log_bands
from lipmotion.speech.sound.analysed_audio import SILENT_ENERGY, AnalysedAudio, analysed
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Unit, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER
from lipmotion.units import is_silent

APART_FRAMES = (11, 40)  # calls of one bout are so far apart, least and most
MIN_CALLS = 4
RISE_DB, LOWEST_DB = 6.0, -35.0
"""A call is so much louder than what is beside it, and its level beside the loudest one is at least the second."""
EDGE_FRAMES = 5  # a bout begins and ends so many frames beside its first and its last call
VOICED_SHARES = (0.15, 0.75)
"""Share of the frames of a bout that is voiced; with less it is a cough, or clicks of tongue or teeth."""
WEIGHTS = (14.8, 0.122, -7.09, -2.93, 3.85, -16.5)
"""The log odds of laughter: the sum of these times the mean correlation of the spectra of successive calls, how far the
level falls between them, the voiced share, that of the quietest frames between them, the log number of calls, and 1."""
MIN_PROBABILITY = 0.7


Curve = NDArray[np.float64]
Voiced = NDArray[np.bool_]


def find_risen_peaks(curve: Curve, prominence: float) -> NDArray[np.intp]:
    """Return the frames of peaks that are at least so far above the higher of the two levels beside them, ascending.

    Beside a peak the curve falls to its lowest value before the next higher peak, or the end. Equal neighbours are no
    peak. The same as ``scipy.signal.find_peaks``, whose import takes longer than recordings of some minutes.
    """
    peaks = np.flatnonzero((curve[1:-1] > curve[:-2]) & (curve[1:-1] > curve[2:])) + 1
    if not len(peaks):
        return peaks
    lowest, heights = np.minimum.reduceat(curve, [0, *peaks]), curve[peaks]
    before = _find_fall(heights, lowest[:-1])
    after = _find_fall(heights[::-1], lowest[:0:-1])[::-1]
    return peaks[heights - np.maximum(before, after) >= prominence]


def _find_fall(heights: Curve, lowest: Curve) -> Curve:
    """Return how low the curve falls before each peak, back to the one before it that is higher [shape=(P,)]."""
    falls, higher = [], list[tuple[float, float]]()
    for height, value in zip(heights.tolist(), lowest.tolist(), strict=True):
        fall = value
        while higher and higher[-1][0] <= height:
            fall = min(fall, higher.pop()[1])
        falls.append(fall)
        higher.append((height, fall))
    return np.array(falls)


SMOOTHING_FRAMES = 2.0  # standard deviation of the window that levels are smoothed with
WORD_CONFIDENCE, MAX_WORD_SHARE = 0.5, 0.2
"""Phones of this confidence, and those that are known, are words; in laughter they have at most this share."""
BREATH_S, BREATH_PAUSE_S = (0.16, 1.2), 0.25
"""Least and most duration of a breath, and the least one of the pause that it is in."""
BREATH_RISE_DB = (7.0, 15.0)
"""A breath is so much louder from 1 to 7.6 kHz than the quiet around it: where it begins, and where it is clear."""
BREATH_EDGE_DB, BREATH_EDGE_FRAMES = 6.0, 12  # it rises and falls by so much within so many frames beside it
BREATH_FROM_SPEECH = (7, 4)
"""Frames from the last voiced one before a breath, and to the first one after it: nearer is the end of a phone."""
BREATH_LEVEL_DB = -12.0  # the level of a breath beside the loud frames of the recording is at most this
BREATH_TILT_DB = (-8.0, 6.0)  # level from 3.5 to 7.6 kHz beside that from 1 to 3.5 kHz: s and sh are brighter
BREATH_LOW_DB = -4.0  # level under 1 kHz beside that from 1 to 3.5 kHz, at most: rumble and plosives have more
PAUSE_PIECE_S = 600.0  # longer pauses are searched in pieces: silence may last for hours
QUIET_REACH = round(2 * FRAME_RATE_HZ)  # the quiet around a pause is looked for so many frames beside it
QUIET_SHARE = 0.08  # share of the frames around one that are at most as loud as the quiet there
BLOCK_FRAMES = 2000  # frames whose powers are in memory at once


def find_voice_events(audio: Audio, units: Timeline[Unit]) -> tuple[VoiceEvent, ...]:
    """Return what is detected in a recording beside words, in the order of time; events of a kind do not overlap.

    audio : at 16 kHz
    Raises InputError: as ``speech.features.mfcc`` says.
    """
    detected = list[VoiceEvent]()
    for first, sound in analysed(audio).between_silences:
        at_s = first / FRAME_RATE_HZ
        phones = units.between(at_s, at_s + sound.duration_s)
        energy_db = sound.log_energy.astype(np.float64) * DB
        level_db = scipy.ndimage.gaussian_filter1d(energy_db, SMOOTHING_FRAMES, mode="nearest")
        voiced = np.isfinite(log_f0(sound))
        events = *_find_laughs(sound, level_db, voiced, phones), *_find_breaths(sound, level_db, voiced, phones)
        detected += [event.shifted(at_s) for event in events]
    return tuple(sorted(detected, key=lambda event: event.start_s))


def silence_units(units: Timeline[Unit], others: Sequence[tuple[float, float]]) -> Timeline[Unit]:
    """Return recognised phones in time which are silence where something else is heard; known phones stay.

    others : from when to when, in seconds
    """
    spans = []
    for span in units:
        inside_s = sum(_find_overlap((span.start_s, span.end_s), other) for other in others)
        is_word = span.label.confidence is None or inside_s < span.duration_s / 2
        spans.append(span if is_word else replace(span, label=Unit("sil", confidence=span.label.confidence)))
    return Timeline(tuple(spans))


DB = 10 / np.log(10)  # decibels of a natural logarithm of power


def _find_laughs(audio: AnalysedAudio, level_db: Curve, voiced: Voiced, units: Timeline[Unit]) -> Iterator[VoiceEvent]:
    """Yield laughter where hardly any words are known or confirmed."""
    sure = (span for span in units if span.label.confidence is None or span.label.confidence >= WORD_CONFIDENCE)
    words = [span for span in sure if not is_silent(span.label.phone)]
    peaks = find_risen_peaks(level_db, RISE_DB)
    peaks = peaks[level_db[peaks] >= level_db.max() + LOWEST_DB]
    gaps = np.diff(peaks)
    breaks = np.flatnonzero((gaps < APART_FRAMES[0]) | (gaps > APART_FRAMES[1])) + 1
    for calls in np.split(peaks, breaks):
        if len(calls) < MIN_CALLS:
            continue
        first, end = max(int(calls[0]) - EDGE_FRAMES, 0), min(int(calls[-1]) + EDGE_FRAMES + 1, len(level_db))
        share, levels = float(voiced[first:end].mean()), level_db[calls]
        if not VOICED_SHARES[0] <= share <= VOICED_SHARES[1]:
            continue
        quietest = [before + int(level_db[before:after].argmin()) for before, after in pairwise(calls.tolist())]
        depth_db = np.mean(np.minimum(levels[1:], levels[:-1]) - level_db[quietest])
        spectra = _compute_bands(audio, slice(first, end))[calls - first].astype(np.float64)
        spectra -= spectra.mean(axis=1, keepdims=True)
        spectra /= np.maximum(np.linalg.norm(spectra, axis=1, keepdims=True), 1e-9)
        likeness = (spectra[1:] * spectra[:-1]).sum(axis=1).mean()
        figures = [likeness, depth_db, share, voiced[quietest].mean(), np.log(len(calls)), 1.0]
        probability = float(1 / (1 + np.exp(-np.dot(WEIGHTS, figures))))
        start_s, end_s = first / FRAME_RATE_HZ, end / FRAME_RATE_HZ
        word_s = sum(_find_overlap((span.start_s, span.end_s), (start_s, end_s)) for span in words)
        if probability >= MIN_PROBABILITY and word_s <= MAX_WORD_SHARE * (end_s - start_s):
            loudness = 2 ** ((levels - levels.max()) / 10)
            timed_calls = zip((calls / FRAME_RATE_HZ).tolist(), loudness.tolist(), strict=True)
            yield VoiceEvent(start_s, end_s, LAUGHTER, probability, tuple(timed_calls))


def _find_breaths(audio: AnalysedAudio, level_db: Curve, voiced: Voiced, units: Timeline[Unit]) -> Iterator[VoiceEvent]:
    heard = level_db[level_db > (SILENT_ENERGY + 1) * DB]  # within passages
    loud_db, spoken = float(np.percentile(heard if len(heard) else level_db, 95)), np.flatnonzero(voiced)
    ends_s = [0.0, *(span.end_s for span in units if not is_silent(span.label.phone))]
    starts_s = [*(span.start_s for span in units if not is_silent(span.label.phone))]
    starts_s.append(max((span.end_s for span in units), default=0.0))
    silences = [
        (first_s, min(first_s + PAUSE_PIECE_S, end_s))
        for start_s, end_s in zip(ends_s, starts_s, strict=True)
        if end_s - start_s >= BREATH_PAUSE_S
        for first_s in np.arange(start_s, end_s, PAUSE_PIECE_S).tolist()
    ]
    for start_s, end_s in silences:
        pause = range(round(start_s * FRAME_RATE_HZ), round(end_s * FRAME_RATE_HZ))
        around = slice(max(pause.start - QUIET_REACH, 0), min(pause.stop + QUIET_REACH, len(level_db)))
        for begin, end, rise_db in _find_noises(_compute_bands(audio, around), voiced[around]):
            first, stop = begin + around.start, end + around.start
            if first < pause.start or stop > pause.stop or level_db[first:stop].max() - loud_db > BREATH_LEVEL_DB:
                continue
            place = int(np.searchsorted(spoken, first))
            before = first - spoken[place - 1] if place else np.inf
            after = spoken[place] - stop if place < len(spoken) else np.inf
            if before >= BREATH_FROM_SPEECH[0] and after >= BREATH_FROM_SPEECH[1]:
                strength = float(np.interp(rise_db, BREATH_RISE_DB, (0, 1)))
                yield VoiceEvent(first / FRAME_RATE_HZ, stop / FRAME_RATE_HZ, BREATH, strength)


def _find_noises(bands: NDArray[np.float32], voiced: Voiced) -> Iterator[tuple[int, int, float]]:
    """Yield first frame, the one after the last, and rise in decibels of noise that is as a breath's."""
    centres, starts = find_centres(), range(0, len(bands), BLOCK_FRAMES)
    low, middle, high, bright = (
        np.concatenate([np.exp(bands[n : n + BLOCK_FRAMES, inside].astype(np.float64)).mean(axis=1) for n in starts])
        for lowest_hz, highest_hz in ((0, 1000), (1000, 3500), (3500, 7600), (1000, np.inf))
        for inside in [(centres >= lowest_hz) & (centres < highest_hz)]
    )
    level = scipy.ndimage.gaussian_filter1d(DB * np.log(bright), SMOOTHING_FRAMES, mode="nearest")
    around = 2 * QUIET_REACH + 1
    quiet = scipy.ndimage.rank_filter(level, int(QUIET_SHARE * around), around, mode="nearest")
    edges = np.flatnonzero(np.diff(np.r_[False, (level > quiet + BREATH_RISE_DB[0]) & ~voiced, False]))
    for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if not BREATH_S[0] <= (stop - first) / FRAME_RATE_HZ <= BREATH_S[1]:
            continue
        run, top_db = slice(first, stop), level[first:stop].max()
        left = level[max(first - BREATH_EDGE_FRAMES, 0) : first + 1].min()
        right = level[stop - 1 : stop + BREATH_EDGE_FRAMES].min()
        tilt_db = DB * np.log(high[run].mean() / middle[run].mean())
        low_db = DB * np.log(low[run].mean() / middle[run].mean())
        shaped = BREATH_TILT_DB[0] <= tilt_db <= BREATH_TILT_DB[1] and low_db <= BREATH_LOW_DB
        if shaped and top_db - max(left, right) >= BREATH_EDGE_DB:
            yield first, stop, float(np.max(level[run] - quiet[run]))


def _compute_bands(audio: AnalysedAudio, frames: slice) -> NDArray[np.float32]:
    """Return ``log_bands`` of a range of frames, computed of these alone [shape=(N, 40)]."""
    return log_bands(audio.samples[frames.start * HOP : max(frames.stop - 1, frames.start) * HOP])


def _find_overlap(one: tuple[float, float], other: tuple[float, float]) -> float:
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)
