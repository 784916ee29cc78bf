"""Frames of a recording that are too loud for silence, or too quiet for speech.

Levels are measured within the sound: against its loudest quarter of a second, and against the noise beneath speech. So
silence, zeros or another noise before and after what is said change nothing.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

DECIBEL = np.log(10) / 10  # a decibel, as natural logarithm of energy
LEVEL_FRAMES = 25  # the loud level is that of the loudest quarter of a second: a click is shorter
NOISE_FRAMES = 201  # within half as many frames of speech there is a closure or a pause, in which the noise is heard
SMOOTHING_FRAMES = 11  # the energy is averaged over so many frames
SOUND_DROP, QUIET_DROP = 20 * DECIBEL, 35 * DECIBEL
"""Sound within the first of the loud level is too loud for silence; beyond the second, too quiet for speech."""
ABOVE_NOISE, NOISE_SHARE = 6 * DECIBEL, 0.3
"""Sound is louder than the noise by so much, or by this share of the way to the loud level where that is less."""
MIN_RANGE = 6 * DECIBEL
"""Where the loud level is no further above the noise, as in tones and in noise alone, nothing is said."""
NEAR_LOUD = 20 * DECIBEL  # the noise is measured around frames no further beneath the loud level
PAUSE_FRAMES, MIN_FRAMES = 30, 6  # shorter pauses are part of the sound around them; shorter sounds are clicks
QUIET_REACH_FRAMES = 10
"""A frame is quiet only if all frames within so many are: the closure of a stop is part of speech."""


def smooth_level(log_energy: NDArray[np.floating], smoothing: int = SMOOTHING_FRAMES) -> NDArray[np.float64]:
    """Return the log energy averaged over an odd number of frames [shape=(T,)]."""
    padded = np.pad(log_energy, smoothing // 2, "edge")
    return np.convolve(padded, np.full(smoothing, 1 / smoothing), "valid")


def average_power(log_energy: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the logarithm of the energy averaged over a quarter of a second around every frame [shape=(T,)]."""
    highest = float(log_energy.max())
    power = np.exp(log_energy.astype(np.float64) - highest)
    return highest + np.log(np.maximum(scipy.ndimage.uniform_filter1d(power, LEVEL_FRAMES, mode="constant"), 1e-12))


def measure_levels(log_energy: NDArray[np.floating]) -> tuple[float, float]:
    """Return the loud level of a recording and that of its noise, natural logarithms as ``log_energy`` [shape=(T,)]."""
    loud = float(average_power(log_energy).max())
    smooth = smooth_level(log_energy)
    spoken = smooth > loud - NEAR_LOUD
    half = NOISE_FRAMES // 2
    sides = half // 2, -(half // 2)
    before, after = (scipy.ndimage.minimum_filter1d(smooth, half + 1, mode="nearest", origin=side) for side in sides)
    lowest = np.maximum(before, after)  # at the edge of another silence, the noise is that of the other side
    return loud, float(np.median(lowest[spoken])) if spoken.any() else loud


def find_loud_frames(log_energy: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which frames are louder than the noise, and not far beneath the loud level [shape=(T,)]."""
    loud, noise = measure_levels(log_energy)
    if loud - noise < MIN_RANGE:
        return np.zeros(len(log_energy), bool)
    threshold = max(loud - SOUND_DROP, noise + min(ABOVE_NOISE, NOISE_SHARE * (loud - noise)))
    return smooth_level(log_energy) > threshold


def find_sound_runs(sound: NDArray[np.bool_], pause: int = PAUSE_FRAMES) -> list[tuple[int, int]]:
    """Return runs of frames with sound, without clicks, as (first, end); ``pause`` frames without sound end a run."""
    frames = np.flatnonzero(sound)
    if not len(frames):
        return []
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > pause) + 1)
    return [(int(run[0]), int(run[-1]) + 1) for run in runs if run[-1] + 1 - run[0] >= MIN_FRAMES]


def find_spoken_frames(log_energy: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return the frames with sound, and those of short pauses in it [shape=(T,)]."""
    spoken = np.zeros(len(log_energy), bool)
    for first, end in find_sound_runs(find_loud_frames(log_energy)):
        spoken[first:end] = True
    return spoken


def find_quiet_frames(log_energy: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which frames are too quiet for speech [shape=(T,)], from natural logarithms [shape=(T,)]."""
    loudest = scipy.ndimage.maximum_filter1d(log_energy, 2 * QUIET_REACH_FRAMES + 1, mode="nearest")
    return loudest < measure_levels(log_energy)[0] - QUIET_DROP
