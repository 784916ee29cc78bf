"""Where a recording may hold speech: passages that are animated by themselves, and stretches that recognisers take.

A passage is what somebody might have kept in a file of its own: a line between silences, or one that is much louder or
softer than the one before. Its features are normalised, and its speaker judged, by itself.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lipmotion.hmm.loudness import DECIBEL, MIN_RANGE, average_power, find_loud_frames, find_sound_runs, smooth_level
from lipmotion.speech.features.mfcc import DYNAMIC_RANGE, HOP, WINDOW
from lipmotion.types import Audio
from lipmotion.types.audio import to_sixteen_bits

PAUSE_FRAMES = 40  # sound with shorter pauses is one stretch
MARGIN_FRAMES = 40  # frames before and after the sound that belong to its stretch: recognisers expect a little silence
JOINED_FRAMES = 60
"""Stretches nearer than this, with their margins, are joined: words say more of one another than of nothing."""
LONGEST_FRAMES = 1000
"""Longer stretches are cut where they are quietest: the time of phone networks grows faster than the length."""

SEPARATE_FRAMES = 50  # a longer pause separates passages
SHORT_FRAMES, NEAR_FRAMES = 150, 150
"""A passage shorter than the first belongs to a neighbour nearer than the second: one word says little of a voice."""
SOFT_FRAMES, SOFT_RANGE = 50, 15 * DECIBEL
"""So many frames beside loud ones, whose level varies by more than this, are a softer voice: breath varies less."""
LEVEL_STEP = 15 * DECIBEL  # voices with a dip between them are passages of their own where their levels differ by more
PASSAGE_MARGIN = 75
"""Frames before and after the sound of a passage that belong to it, where they are not digital silence."""
CUT_FROM, CUT_FRAMES, CUT_STEP = 6, 6, 6 * DECIBEL
"""So many frames and more beside sound, a level that changes at once by the last, for good, is of another recording."""
LOCAL_FRAMES, LOCAL_DROP, SOFTEST_DROP = 301, 30 * DECIBEL, 42 * DECIBEL
"""Sound lies less than the second below the loudest within the first, and less than the third below all of it."""
STEADY, STEADY_FRAMES = 10 * DECIBEL, 201
"""The level of a voice falls by more than the first from the loudest of so many frames around."""
TONE_FRAMES, TONE_RANGE, TONE_SHARE, TONE_DROP = 15, 0.2, 0.985, 20 * DECIBEL
TONE_BLOCK = 6000
"""A tone has a log energy within the second for so many frames, this share of its power at one frequency, and is no
softer than the last beneath the loudest frame. No voice in 13 minutes of speech, or of a synthesiser, is a tone."""
GATED_DROP, FILLED_DROP = 70 * DECIBEL, 33 * DECIBEL
"""So far beneath the loud level nothing is recorded; so far beneath it, noise stands in place of nothing."""
SAME_LEVEL = 0.1
"""Root mean square of the loudest quarter of a second of a passage, once its level is that of all others."""


class Stretch(NamedTuple):
    """Frames of a recording: from ``first`` to before ``end``."""

    first: int
    end: int


def find_sound(log_energy: NDArray[np.float32]) -> list[Stretch]:
    """Return the stretches of a recording that may hold speech, in order, without overlap.

    log_energy : of every frame, natural logarithm [shape=(T,)]
    None is longer than ``LONGEST_FRAMES``. A recording of constant energy has none.
    """
    stretches: list[Stretch] = []
    for sound_first, sound_end in find_sound_runs(find_loud_frames(log_energy), PAUSE_FRAMES):
        earliest = stretches[-1].end if stretches else 0
        first, end = max(earliest, sound_first - MARGIN_FRAMES), min(len(log_energy), sound_end + MARGIN_FRAMES)
        if stretches and first - earliest <= JOINED_FRAMES and end - stretches[-1].first <= LONGEST_FRAMES:
            first = stretches.pop().first
        while end - first > LONGEST_FRAMES:  # cut in the quietest frame of its second half
            half = first + LONGEST_FRAMES // 2
            cut = half + int(np.argmin(smooth_level(log_energy[half : first + LONGEST_FRAMES])))
            stretches.append(Stretch(first, cut))
            first = cut
        stretches.append(Stretch(first, end))
    return stretches


def read_stretch(audio: Audio, stretch: Stretch) -> bytes:
    """Return the samples of a stretch of a recording at 16 kHz, as 16-bit integers."""
    return to_sixteen_bits(audio.samples[stretch.first * HOP : stretch.end * HOP]).astype("<i2").tobytes()


def find_passages(log_energy: NDArray[np.float32]) -> list[Stretch]:
    """Return the passages of a recording, in order, without overlap; none where there is no sound but steady noise.

    log_energy : of every frame, natural logarithm [shape=(T,)]
    Each is found by its own level, so that it is the same wherever it stands, and whatever silence is around it.
    """
    passages: list[Stretch] = []
    floor = float(log_energy.max() + np.log(DYNAMIC_RANGE)) + 1e-3
    regions, sound = _divide_by_level(log_energy)
    for region in regions:
        runs: list[Stretch] = []
        within = slice(region.first, region.end)
        loud = find_loud_frames(log_energy[within])
        for first, end in find_sound_runs(loud, SEPARATE_FRAMES):
            run = Stretch(region.first + first, region.first + end)
            short = runs and min(run.end - run.first, runs[-1].end - runs[-1].first) < SHORT_FRAMES
            if short and run.first - runs[-1].end < NEAR_FRAMES:
                runs[-1] = Stretch(runs[-1].first, run.end)
            else:
                runs.append(run)
        soft = _find_soft_runs(loud, sound[within], log_energy[within])
        runs = sorted([*runs, *(Stretch(region.first + first, region.first + end) for first, end in soft)])
        for number, run in enumerate(runs):
            before = (runs[number - 1].end + run.first + 1) // 2 if number else region.first
            after = (run.end + runs[number + 1].first + 1) // 2 if number + 1 < len(runs) else region.end
            first, end = max(before, run.first - PASSAGE_MARGIN), min(after, run.end + PASSAGE_MARGIN)
            lead = _measure_margin(log_energy[first : run.first][::-1], floor, 1)
            passages.append(Stretch(run.first - lead, run.end + _measure_margin(log_energy[run.end : end], floor, 2)))
    return passages


def find_tones(samples: NDArray[np.float32], log_energy: NDArray[np.float32]) -> list[Stretch]:
    """Return where a steady tone sounds, as one that covers a word, in order; recognisers hear nothing beside it.

    samples    : [shape=(N,)]
    log_energy : of their frames, natural logarithm [shape=(T,)]
    """
    extremes = scipy.ndimage.maximum_filter1d, scipy.ndimage.minimum_filter1d
    ranges = np.subtract(*(find(log_energy, TONE_FRAMES) for find in extremes))
    steady = (ranges < TONE_RANGE) & (log_energy > log_energy.max() - TONE_DROP)
    window, tones = np.hanning(WINDOW), []
    for first, end in find_sound_runs(scipy.ndimage.maximum_filter1d(steady, TONE_FRAMES), 1):
        pure = np.zeros(end - first, bool)
        for start in range(first, end, TONE_BLOCK):  # hours may be steady
            stop = min(start + TONE_BLOCK, end)
            begin, over = start * HOP - WINDOW // 2, (stop - 1) * HOP + WINDOW - WINDOW // 2
            block = np.pad(samples[max(begin, 0) : over], (max(-begin, 0), max(over - len(samples), 0)))
            power = np.square(np.abs(np.fft.rfft(sliding_window_view(block, WINDOW)[::HOP] * window)))
            near = np.abs(np.arange(power.shape[1]) - np.median(power.argmax(axis=1))) <= 3
            pure[start - first : stop - first] = power[:, near].sum(axis=1) > TONE_SHARE * power.sum(axis=1)
        runs = find_sound_runs(pure, 1)
        tones += [Stretch(first + start, first + stop) for start, stop in runs if stop - start >= TONE_FRAMES]
    return tones


def _measure_margin(log_energy: NDArray[np.float32], floor: float, reaching: int) -> int:
    """Return how many frames beside a sound, from the nearest on, are of its recording, not cut or mixed."""
    zeros = np.flatnonzero(log_energy <= floor)
    count = max(int(zeros[0]) - reaching, 0) if len(zeros) else len(log_energy)
    for cut in range(CUT_FROM, count - CUT_FRAMES):
        room, other = log_energy[cut - CUT_FRAMES : cut - 1], log_energy[cut + 1 : count]
        step = CUT_STEP if np.ptp(room) < MIN_RANGE else 2 * CUT_STEP  # a sound that fades becomes softer by itself
        if other.max() < room.min() - step or other.min() > room.max() + step:
            return cut - 1
    return count


def _find_soft_runs(
    loud: NDArray[np.bool_], sound: NDArray[np.bool_], log_energy: NDArray[np.float32]
) -> list[tuple[int, int]]:
    """Return runs of a voice that stays softer than what is loud before it, as of somebody who turns away."""
    smooth, runs = smooth_level(log_energy), []
    beyond = sound & ~scipy.ndimage.maximum_filter1d(loud, 2 * PASSAGE_MARGIN + 1)
    for first, end in find_sound_runs(beyond, SEPARATE_FRAMES) if loud.any() else ():
        if beyond[first:end].sum() >= SOFT_FRAMES and np.ptp(smooth[first:end]) > SOFT_RANGE:
            loud_end = max(first - PASSAGE_MARGIN, 0)
            runs.append((loud_end + int(np.argmin(smooth[loud_end : first + 1])), end))
    return runs


def _divide_by_level(log_energy: NDArray[np.float32]) -> tuple[list[Stretch], NDArray[np.bool_]]:
    """Return the recording cut in the quietest frames between voices of other levels, and in long silence.

    Also which frames sound as a voice would beside what is near.
    """
    level = average_power(log_energy)
    local = scipy.ndimage.maximum_filter1d(level, LOCAL_FRAMES, mode="nearest")
    smooth = smooth_level(log_energy)
    lowest = scipy.ndimage.minimum_filter1d(smooth, STEADY_FRAMES, mode="nearest")
    falls = scipy.ndimage.maximum_filter1d(local - lowest, STEADY_FRAMES) > STEADY
    sound = (smooth > local - LOCAL_DROP) & (level > level.max() - SOFTEST_DROP) & falls
    if not sound.any():
        return [], sound
    cuts = {0, len(level)}
    for pause in (SEPARATE_FRAMES, SHORT_FRAMES // 10):  # whole lines first, then voices that follow at once
        before: tuple[float, int, int] | None = None
        for first, end in find_sound_runs(sound, pause):
            loud, length = float(level[first:end].max()), end - first
            if before is not None:
                step = abs(loud - before[0]) > LEVEL_STEP and min(length, before[2]) > SHORT_FRAMES // 2
                divided = any(before[1] < cut <= first for cut in cuts)
                apart = NEAR_FRAMES if min(length, before[2]) < SHORT_FRAMES else SEPARATE_FRAMES
                if step or divided or first - before[1] > apart:
                    if not divided:
                        cuts.add(before[1] + int(np.argmin(smooth[before[1] : first + 1])))
                else:
                    loud, length = max(loud, before[0]), length + before[2]
            before = loud, end, length
    return [Stretch(first, end) for first, end in pairwise(sorted(cuts))], sound


def fill_gaps(samples: NDArray[np.float32], log_energy: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the samples of a passage with noise in the digital silence between its words, as of a noise gate.

    samples, log_energy : as of ``find_passage_gain``: the samples are those of the passage
    Features of nothing are unlike those of any room: beside them all voices would look like that of the training.
    """
    loud = float(average_power(log_energy).max())
    runs = find_sound_runs(log_energy < loud - GATED_DROP, 1)
    if not runs:
        return samples
    filled, rng = samples.copy(), np.random.default_rng(0)
    deviation = np.exp((loud - FILLED_DROP) / 2) / np.sqrt(WINDOW)
    for first, end in runs:
        gap = filled[max(first * HOP - WINDOW // 2, 0) : (end - 1) * HOP + WINDOW // 2]
        gap += (deviation * rng.standard_normal(len(gap))).astype(np.float32)
    return filled


def find_passage_gain(log_energy: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the factors that bring the frames of a passage to the level of all passages [shape=(T,)].

    log_energy : of its frames, natural logarithm [shape=(T,)]
    Where its voice becomes softer, it is raised.
    """
    level = average_power(log_energy)
    loud = float(level.max())
    gain = np.full(len(level), SAME_LEVEL / np.exp((loud - np.log(WINDOW)) / 2))
    lower = loud - scipy.ndimage.maximum_filter1d(level, STEADY_FRAMES + 1, mode="nearest") - STEADY
    sound = np.flatnonzero(smooth_level(log_energy) > loud - LOCAL_DROP - STEADY)
    if len(sound) and lower[sound].max() > 0:
        raised = np.clip(lower[sound], 0, LOCAL_DROP) / 2
        gain *= np.exp(np.interp(np.arange(len(level)), sound, raised))
    return gain


def apply_gain(samples: NDArray[np.float32], frames: Any, gain: Any, first: int = 0) -> NDArray[np.float32]:
    """Return samples times a gain that is known in some frames, and interpolated between them.

    first : number of the first sample, from frame 0
    """
    times = (first + np.arange(len(samples))) / HOP
    return (samples * np.interp(times, frames, gain)).astype(np.float32)
