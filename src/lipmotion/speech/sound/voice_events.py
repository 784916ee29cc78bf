"""Voice events: what a sound says beside words: laughter, breaths in pauses, phrases that are whispered or shouted.

Everything but where phones are follows from the sound. Rules are strict: a false event is worse than a missed one.

Sources: whispering, which has no voice, R. W. Morris and M. A. Clements, "Reconstruction of speech from whispers",
Medical Engineering & Physics 24, 2002; shouting, which is louder, higher, and has more energy at high frequencies, H.
Traunmueller and A. Eriksson, "Acoustic effects of variation in vocal effort by men, women, and children", Journal of
the Acoustical Society of America 107, 2000; breaths, D. Ruinskiy and Y. Lavner, "An effective algorithm for automatic
detection and exact demarcation of breath sounds in speech and song signals", IEEE Transactions on Audio, Speech and
Language Processing 15, 2007. The limits are ours, chosen on recordings (docs/expression.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP, find_centres, log_bands
from lipmotion.speech.sound.analysed_audio import SILENT_ENERGY, AnalysedAudio, analysed
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Unit, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER, SHOUT, WHISPER
from lipmotion.units import VOWELS, is_silent

APART_FRAMES = (11, 40)
"""Calls of one bout are so far apart, least and most."""
MIN_CALLS = 4
RISE_DB, LOWEST_DB = 6.0, -35.0
"""A call is so much louder than what is beside it, and its level beside the loudest one is at least the second."""
EDGE_FRAMES = 5
"""A bout begins and ends so many frames beside its first and its last call."""
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


SMOOTHING_FRAMES = 2.0
"""Standard deviation of the window that levels are smoothed with."""
WORD_CONFIDENCE, MAX_WORD_SHARE = 0.5, 0.2
"""Phones of this confidence, and those that are known, are words; in laughter they have at most this share."""
PHRASE_PAUSE_S, MIN_PHRASE_S, MIN_VOWELS = 0.25, 0.6, 2
"""Phrases are divided by such pauses, and judged from so much speech, and so many vowels, on."""
LOUD_DB = 20.0
"""The frames of a phrase that are at most so far under its loudest are judged."""
MIN_SNR_DB, BELOW_LOUDEST_DB = 12.0, 20.0
"""Whispering is judged in phrases whose loudest frames are so much louder than the quiet of the recording, as noise
hides a voice; and half of whose frames are at most so far under its loudest ones, beside which no F0 is found."""
WHISPERED_SHARES = (0.12, 0.24)
"""A phrase is whispered up to the first share of voiced frames, and not from the second one on."""
MIN_PHRASES = 5
"""A shout is one beside the other phrases of a recording: at least so many."""
SHOUT_SEMITONES, SHOUT_TILT_DB, SHOUT_DB = (4.0, 8.0), (3.0, 7.0), (4.0, 8.0)
"""How much higher, brighter (1 to 4.5 kHz beside what is lower) and louder than the median phrase a shout is: where it
begins, and where it is one. The least of the three counts."""
MIN_VOICED = 15
"""Frames without which a phrase has no pitch."""
BREATH_S, BREATH_PAUSE_S = (0.16, 1.2), 0.25
"""Least and most duration of a breath, and the least one of the pause that it is in."""
BREATH_RISE_DB = (7.0, 15.0)
"""A breath is so much louder from 1 to 7.6 kHz than the quiet around it: where it begins, and where it is clear."""
BREATH_EDGE_DB, BREATH_EDGE_FRAMES = 6.0, 12
"""It rises and falls by so much within so many frames beside it."""
BREATH_FROM_SPEECH = (7, 4)
"""Frames from the last voiced one before a breath, and to the first one after it: nearer is the end of a phone."""
BREATH_LEVEL_DB = -12.0
"""The level of a breath beside the loud frames of the recording is at most this."""
BREATH_TILT_DB = (-8.0, 6.0)
"""Level from 3.5 to 7.6 kHz beside that from 1 to 3.5 kHz: s and sh are brighter."""
BREATH_LOW_DB = -4.0
"""Level under 1 kHz beside that from 1 to 3.5 kHz, at most: rumble and plosives have more."""
PAUSE_PIECE_S = 600.0
"""Longer pauses are searched in pieces: silence may last for hours."""
QUIET_REACH_S = 2.0
"""The quiet around a pause is looked for so far beside it."""
QUIET_SHARE = 0.08
"""Share of the frames around one that are at most as loud as the quiet there."""
BLOCK_FRAMES = 2000
"""Frames whose surroundings are in memory at once."""


def find_voice_events(audio: Audio, units: Timeline[Unit]) -> tuple[VoiceEvent, ...]:
    """Return what is detected in a recording beside words, in the order of time; events of a kind do not overlap.

    audio : at 16 kHz
    Raises InputError: as ``speech.features.mfcc`` says.
    """
    detected, judged = list[VoiceEvent](), list[tuple[float, float, tuple[float, float, float]]]()
    for first, sound in analysed(audio).between_silences:
        at_s = first / FRAME_RATE_HZ
        phones = units.between(at_s, at_s + sound.duration_s)
        level_db = _smooth(analysed(sound).log_energy.astype(np.float64) * DB)
        pitch = log_f0(sound).astype(np.float64) * 12 / np.log(2)  # semitones
        voiced = np.isfinite(pitch)
        laughs = tuple(_laughs(sound, level_db, voiced, phones))
        phrases = [
            phrase
            for phrase in _phrases(phones)
            if not any(_find_overlap(phrase, (laugh.start_s, laugh.end_s)) > 0 for laugh in laughs)
        ]
        events = *laughs, *_breaths(sound, level_db, voiced, phones), *_whispers(level_db, voiced, phrases)
        detected += [event.shifted(at_s) for event in events]
        efforts = _efforts(sound, level_db, pitch, phrases)
        judged += [(start_s + at_s, end_s + at_s, effort) for (start_s, end_s), effort in efforts]
    return tuple(sorted([*detected, *_shouts(judged)], key=lambda event: event.start_s))


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


DB = 10 / np.log(10)
"""Decibels of a natural logarithm of power."""


def _select_heard(level_db: Curve) -> Curve:
    """Return the levels within passages, over which levels are compared; all, where there is none."""
    heard = level_db[level_db > (SILENT_ENERGY + 1) * DB]
    return heard if len(heard) else level_db


def _laughs(audio: AnalysedAudio, level_db: Curve, voiced: Voiced, units: Timeline[Unit]) -> Iterator[VoiceEvent]:
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
        spectra = _bands(audio, slice(first, end))[calls - first].astype(np.float64)
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


def _phrases(units: Timeline[Unit]) -> list[tuple[float, float]]:
    """Return start and end, in seconds, of the phrases that are long enough to be judged."""
    phrases: list[tuple[float, float, float, int]] = []
    for span in units:
        if is_silent(span.label.phone):
            continue
        vowel = int(span.label.phone in VOWELS)
        if phrases and span.start_s - phrases[-1][1] < PHRASE_PAUSE_S:
            start_s, _, said_s, vowels = phrases[-1]
            phrases[-1] = start_s, span.end_s, said_s + span.duration_s, vowels + vowel
        else:
            phrases.append((span.start_s, span.end_s, span.duration_s, vowel))
    return [each[:2] for each in phrases if each[2] >= MIN_PHRASE_S and each[3] >= MIN_VOWELS]


def _whispers(level_db: Curve, voiced: Voiced, phrases: Sequence[tuple[float, float]]) -> Iterator[VoiceEvent]:
    quiet_db, loud_db = np.percentile(_select_heard(level_db), (10, 99))
    for start_s, end_s in phrases:
        frames = _frames(start_s, end_s)
        middle_db, loudest_db = np.percentile(level_db[frames], (50, 95)) if len(level_db[frames]) else (quiet_db,) * 2
        if loudest_db - quiet_db < MIN_SNR_DB or middle_db - loud_db < -BELOW_LOUDEST_DB:
            continue
        share = float(voiced[frames][level_db[frames] > loudest_db - LOUD_DB].mean())
        strength = _risen(-share, (-WHISPERED_SHARES[1], -WHISPERED_SHARES[0]))
        if strength > 0:
            yield VoiceEvent(start_s, end_s, WHISPER, strength)


def _efforts(
    audio: AnalysedAudio, level_db: Curve, pitch: Curve, phrases: Sequence[tuple[float, float]]
) -> Iterator[tuple[tuple[float, float], tuple[float, float, float]]]:
    """Yield the phrases with a voice, and how high (semitones), bright and loud (decibels) it is there."""
    high = (find_centres() >= 1000) & (find_centres() < 4500)
    low = find_centres() < 1000
    for phrase in phrases:
        frames = _frames(*phrase)
        voiced = np.flatnonzero(np.isfinite(pitch[frames]))
        if len(voiced) < MIN_VOICED:
            continue
        levels = level_db[frames][voiced]
        loud = voiced[levels > np.median(levels) - 6]
        powers = np.exp(_bands(audio, frames)[loud])
        tilt_db = DB * np.median(np.log(powers[:, high].sum(axis=1)) - np.log(powers[:, low].sum(axis=1)))
        yield phrase, (np.median(pitch[frames][voiced]), tilt_db, DB * np.log(np.mean(np.exp(levels / DB))))


def _shouts(judged: Sequence[tuple[float, float, tuple[float, float, float]]]) -> Iterator[VoiceEvent]:
    """Yield the phrases that are higher, brighter and louder than the others, of which the efforts are given."""
    if len(judged) < MIN_PHRASES:
        return
    efforts = np.array([effort for *_, effort in judged])
    for (start_s, end_s, _), values in zip(judged, (efforts - np.median(efforts, axis=0)).tolist(), strict=True):
        limits = (SHOUT_SEMITONES, SHOUT_TILT_DB, SHOUT_DB)
        strength = min(_risen(value, limit) for value, limit in zip(values, limits, strict=True))
        if strength > 0:
            yield VoiceEvent(start_s, end_s, SHOUT, strength)


def _breaths(audio: AnalysedAudio, level_db: Curve, voiced: Voiced, units: Timeline[Unit]) -> Iterator[VoiceEvent]:
    loud_db, spoken = float(np.percentile(_select_heard(level_db), 95)), np.flatnonzero(voiced)
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
        pause, reach = _frames(start_s, end_s), round(QUIET_REACH_S * FRAME_RATE_HZ)
        around = slice(max(pause.start - reach, 0), min(pause.stop + reach, len(level_db)))
        for begin, end, rise_db in _noises(_bands(audio, around), voiced[around]):
            first, stop = begin + around.start, end + around.start
            if first < pause.start or stop > pause.stop or level_db[first:stop].max() - loud_db > BREATH_LEVEL_DB:
                continue
            place = int(np.searchsorted(spoken, first))
            before = first - spoken[place - 1] if place else np.inf
            after = spoken[place] - stop if place < len(spoken) else np.inf
            if before >= BREATH_FROM_SPEECH[0] and after >= BREATH_FROM_SPEECH[1]:
                strength = _risen(rise_db, BREATH_RISE_DB)
                yield VoiceEvent(first / FRAME_RATE_HZ, stop / FRAME_RATE_HZ, BREATH, strength)


def _noises(bands: NDArray[np.float32], voiced: Voiced) -> Iterator[tuple[int, int, float]]:
    """Yield first frame, the one after the last, and rise in decibels of noise that is as a breath's."""
    centres, starts = find_centres(), range(0, len(bands), BLOCK_FRAMES)
    low, middle, high, bright = (
        np.concatenate([np.exp(bands[n : n + BLOCK_FRAMES, inside].astype(np.float64)).mean(axis=1) for n in starts])
        for lowest_hz, highest_hz in ((0, 1000), (1000, 3500), (3500, 7600), (1000, np.inf))
        for inside in [(centres >= lowest_hz) & (centres < highest_hz)]
    )
    level = _smooth(DB * np.log(bright))
    reach = round(QUIET_REACH_S * FRAME_RATE_HZ)
    windows = sliding_window_view(np.pad(level, reach, "edge"), 2 * reach + 1)
    rank = int(QUIET_SHARE * windows.shape[1])
    blocks = (windows[first : first + BLOCK_FRAMES] for first in range(0, len(windows), BLOCK_FRAMES))
    quiet = np.concatenate([np.partition(block, rank, axis=1)[:, rank].copy() for block in blocks])
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


def _bands(audio: AnalysedAudio, frames: slice) -> NDArray[np.float32]:
    """Return ``log_bands`` of a range of frames, computed of these alone [shape=(N, 40)]."""
    return log_bands(audio.samples[frames.start * HOP : max(frames.stop - 1, frames.start) * HOP])


def _frames(start_s: float, end_s: float) -> slice:
    return slice(round(start_s * FRAME_RATE_HZ), round(end_s * FRAME_RATE_HZ))


def _smooth(curve: Curve) -> Curve:
    reach = round(4 * SMOOTHING_FRAMES)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTHING_FRAMES) ** 2)
    return np.convolve(np.pad(curve, reach, "edge"), window / window.sum(), "valid")


def _risen(value: float, limits: tuple[float, float]) -> float:
    return float(np.clip((value - limits[0]) / (limits[1] - limits[0]), 0, 1))


def _find_overlap(one: tuple[float, float], other: tuple[float, float]) -> float:
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)
