"""Breaths in the pauses of a recording: noise with the spectrum of one, apart from what is said.

Everything but where phones are follows from the sound. Rules are strict: a false breath is worse than a missed one.

Source: D. Ruinskiy and Y. Lavner, "An effective algorithm for automatic detection and exact demarcation of breath
sounds in speech and song signals", IEEE Transactions on Audio, Speech and Language Processing 15, 2007. The limits are
ours, chosen on recordings (docs/expression.md).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.hmm.loudness import find_sound_runs
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP, find_centres, log_bands
from lipmotion.speech.sound.analysed_audio import SILENT_ENERGY, AnalysedAudio, analysed
from lipmotion.types import FRAME_RATE_HZ, Audio, Timeline, Unit
from lipmotion.units import is_silent

Curve = NDArray[np.float64]
Voiced = NDArray[np.bool_]


SMOOTHING_FRAMES = 2.0  # standard deviation of the window that levels are smoothed with
BREATH_S, BREATH_PAUSE_S = (0.16, 1.2), 0.25
"""Least and most duration of a breath, and the least one of the pause that it is in."""
BREATH_RISE_DB = 7.0  # a breath is so much louder from 1 to 7.6 kHz than the quiet around it
BREATH_EDGE_DB, BREATH_EDGE_FRAMES = 6.0, 12  # it rises and falls by so much within so many frames beside it
BREATH_FROM_SPEECH = (7, 4)
"""Frames from the last voiced one before a breath, and to the first one after it: nearer is the end of a phone."""
BREATH_LEVEL_DB = -12.0  # the level of a breath beside the loud frames of the recording is at most this
BREATH_TILT_DB = (-8.0, 6.0)  # level from 3.5 to 7.6 kHz beside that from 1 to 3.5 kHz: s and sh are brighter
BREATH_LOW_DB = -4.0
"""Level under 1 kHz beside that from 1 to 3.5 kHz, at most: rumble and plosives have more."""
PAUSE_PIECE_S = 600.0  # longer pauses are searched in pieces: silence may last for hours
QUIET_REACH_S = 2.0  # the quiet around a pause is looked for so far beside it
QUIET_SHARE = 0.08  # share of the frames around one that are at most as loud as the quiet there
BLOCK_FRAMES = 2000  # frames whose surroundings are in memory at once


def find_breaths(audio: Audio, units: Timeline[Unit]) -> tuple[tuple[float, float], ...]:
    """Return start and end, in seconds, of the breaths in a recording, in order.

    audio : at 16 kHz
    Raises InputError: as ``speech.features.mfcc`` says.
    """
    breaths = list[tuple[float, float]]()
    for first, sound in analysed(audio).between_silences:
        at_s = first / FRAME_RATE_HZ
        level_db, voiced = _smooth(sound.log_energy.astype(np.float64) * DB), np.isfinite(log_f0(sound))
        places = _list_breaths(sound, level_db, voiced, units.between(at_s, at_s + sound.duration_s))
        breaths += [(at_s + start / FRAME_RATE_HZ, at_s + stop / FRAME_RATE_HZ) for start, stop in places]
    return tuple(breaths)


DB = 10 / np.log(10)  # decibels of a natural logarithm of power


def _list_breaths(
    audio: AnalysedAudio, level_db: Curve, voiced: Voiced, units: Timeline[Unit]
) -> Iterator[tuple[int, int]]:
    """Yield the first frame of each breath, and the one after the last."""
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
        pause, reach = _frames(start_s, end_s), round(QUIET_REACH_S * FRAME_RATE_HZ)
        around = slice(max(pause.start - reach, 0), min(pause.stop + reach, len(level_db)))
        for begin, end in _noises(_bands(audio, around), voiced[around]):
            first, stop = begin + around.start, end + around.start
            if first < pause.start or stop > pause.stop or level_db[first:stop].max() - loud_db > BREATH_LEVEL_DB:
                continue
            place = int(np.searchsorted(spoken, first))
            before = first - spoken[place - 1] if place else np.inf
            after = spoken[place] - stop if place < len(spoken) else np.inf
            if before >= BREATH_FROM_SPEECH[0] and after >= BREATH_FROM_SPEECH[1]:
                yield first, stop


def _noises(bands: NDArray[np.float32], voiced: Voiced) -> Iterator[tuple[int, int]]:
    """Yield the first frame, and the one after the last, of noise that is as a breath's."""
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
    for first, stop in find_sound_runs((level > quiet + BREATH_RISE_DB) & ~voiced, 1):
        if not BREATH_S[0] <= (stop - first) / FRAME_RATE_HZ <= BREATH_S[1]:
            continue
        run, top_db = slice(first, stop), level[first:stop].max()
        left = level[max(first - BREATH_EDGE_FRAMES, 0) : first + 1].min()
        right = level[stop - 1 : stop + BREATH_EDGE_FRAMES].min()
        tilt_db = DB * np.log(high[run].mean() / middle[run].mean())
        low_db = DB * np.log(low[run].mean() / middle[run].mean())
        shaped = BREATH_TILT_DB[0] <= tilt_db <= BREATH_TILT_DB[1] and low_db <= BREATH_LOW_DB
        if shaped and top_db - max(left, right) >= BREATH_EDGE_DB:
            yield first, stop


def _bands(audio: AnalysedAudio, frames: slice) -> NDArray[np.float32]:
    """Return ``log_bands`` of a range of frames, computed of these alone [shape=(N, 40)]."""
    return log_bands(audio.samples[frames.start * HOP : max(frames.stop - 1, frames.start) * HOP])


def _frames(start_s: float, end_s: float) -> slice:
    return slice(round(start_s * FRAME_RATE_HZ), round(end_s * FRAME_RATE_HZ))


def _smooth(curve: Curve) -> Curve:
    reach = round(4 * SMOOTHING_FRAMES)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTHING_FRAMES) ** 2)
    return np.convolve(np.pad(curve, reach, "edge"), window / window.sum(), "valid")
