"""Claps and beeps in a sound: what people make so that separate recordings can be brought into step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Audio

Array = NDArray[np.float64]

CLAP, BEEP = "clap", "beep"
STEP_S = 0.001
"""Distance of the levels in which claps are looked for."""
BEFORE_S, RISE_S = 0.06, 0.004
"""A clap is louder within ``RISE_S`` than everything in ``BEFORE_S`` before it..."""
LEAST_RISE_DB = 18.0
"""...by this much..."""
DECAY_S, LEAST_DECAY_DB = (0.15, 0.25), 15.0
"""...and between these times after it, it has become this much quieter."""
LEAST_LEVEL_DB = -15.0
"""Claps have at least this level against the loudest millisecond of the recording."""
APART_S = 0.3
"""Where several marks are nearer to each other, the strongest counts."""
MOST_MARKS = 20
"""Most marks of a kind that are kept, the strongest."""
BEEP_FRAME_S, BEEP_STEP_S = 0.032, 0.008
LEAST_TONE_SHARE = 0.9
"""Share of the energy of a beep that is in three neighbouring bands of its spectrum (96 Hz at 16 kHz)."""
LEAST_BEEP_S, LEAST_BEEP_HZ = 0.1, 500.0
LEAST_BEEP_LEVEL_DB = -30.0
"""Beeps have at least this level against the loudest frame."""
FLOOR = 1e-10
BLOCK = 4096
"""Frames whose spectrum is computed at once."""


@dataclass(frozen=True)
class SoundMark:
    """A clap or a beep.

    time_s      : when it begins
    kind        : ``clap`` or ``beep``
    strength_db : how much it stands out
    hertz       : pitch of a beep, else 0
    """

    time_s: float
    kind: str
    strength_db: float
    hertz: float = 0.0


def sound_marks(audio: Audio) -> tuple[SoundMark, ...]:
    """Return the claps and beeps of a recording, by time; there may be none, or sounds that only resemble them."""
    found = [*_claps(audio), *_beeps(audio)]
    return tuple(sorted(found, key=lambda mark: mark.time_s))


def _claps(audio: Audio) -> list[SoundMark]:
    from scipy.ndimage import maximum_filter1d

    size = round(STEP_S * audio.rate_hz)
    sharp = np.diff(audio.samples, prepend=audio.samples[:1])  # claps are brighter than speech
    sharp = sharp[: len(sharp) // size * size].reshape(-1, size)
    power = np.einsum("ts,ts->t", sharp, sharp, dtype=np.float64) / size
    before, rise = round(BEFORE_S / STEP_S), round(RISE_S / STEP_S)
    early, late = (round(time_s / STEP_S) for time_s in DECAY_S)
    if len(power) < before + late + 1:
        return []
    level = 10 * np.log10(power + FLOOR)
    loudest_before = maximum_filter1d(level, before, origin=(before - 1) // 2, mode="nearest")
    peak = maximum_filter1d(level, rise, origin=-(rise // 2), mode="nearest")
    sums = np.concatenate([[0.0], np.cumsum(power)])
    begin = np.minimum(np.arange(len(power)) + early, len(power) - 1)
    end = np.minimum(np.arange(len(power)) + late, len(power))
    after = 10 * np.log10((sums[end] - sums[begin]) / np.maximum(end - begin, 1) + FLOOR)
    rises = peak[1:] - loudest_before[:-1]
    decays = (peak - after)[1:]
    good = (rises >= LEAST_RISE_DB) & (decays >= LEAST_DECAY_DB) & (peak[1:] >= level.max() + LEAST_LEVEL_DB)
    strength = np.minimum(rises, decays)
    return [
        SoundMark((frame + 1) * STEP_S, CLAP, float(strength[frame]))
        for frame in _strongest(np.flatnonzero(good), strength, APART_S / STEP_S)
    ]


def _beeps(audio: Audio) -> list[SoundMark]:
    size, step = round(BEEP_FRAME_S * audio.rate_hz), round(BEEP_STEP_S * audio.rate_hz)
    count = (len(audio.samples) - size) // step + 1
    if count < 1:
        return []
    windows = np.lib.stride_tricks.sliding_window_view(audio.samples, size)[::step]
    tone, hertz, level = np.zeros(count), np.zeros(count), np.zeros(count)
    taper = np.hanning(size).astype(np.float32)
    for start in range(0, count, BLOCK):
        frames = slice(start, min(start + BLOCK, count))
        power = np.abs(np.fft.rfft(windows[frames] * taper, axis=1)) ** 2
        bands = power[:, 1:-1] + power[:, :-2] + power[:, 2:]
        best = bands.argmax(axis=1)
        level[frames] = power.sum(axis=1)
        tone[frames] = bands[np.arange(len(best)), best] / (level[frames] + FLOOR)
        hertz[frames] = (best + 1) / BEEP_FRAME_S
    level = 10 * np.log10(level + FLOOR)
    good = (tone >= LEAST_TONE_SHARE) & (hertz >= LEAST_BEEP_HZ) & (level >= level.max() + LEAST_BEEP_LEVEL_DB)
    same = np.concatenate([[False], good[1:] & good[:-1] & (np.abs(np.diff(hertz)) <= 1.01 / BEEP_FRAME_S), [False]])
    starts = np.flatnonzero(same[1:] & ~same[:-1])
    ends = np.flatnonzero(same[:-1] & ~same[1:])
    least = LEAST_BEEP_S / BEEP_STEP_S
    long = [(first, last) for first, last in zip(starts.tolist(), ends.tolist(), strict=True) if last - first >= least]
    marks = []
    for first, last in long:
        frames = slice(first, last + 1)
        time_s, pitch = (first * step + size / 2) / audio.rate_hz, float(np.median(hertz[frames]))
        marks.append(SoundMark(time_s, BEEP, float(level[frames].mean()), pitch))
    return sorted(marks, key=lambda mark: -mark.strength_db)[:MOST_MARKS]


def _strongest(frames: NDArray[np.intp], strength: Array, apart: float) -> list[int]:
    """Return the strongest of some frames, none nearer to a stronger one than ``apart`` frames."""
    kept: list[int] = []
    for frame in frames[np.argsort(-strength[frames], kind="stable")].tolist():
        if len(kept) == MOST_MARKS:
            break
        if all(abs(frame - other) >= apart for other in kept):
            kept.append(frame)
    return kept
