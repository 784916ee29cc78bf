"""Signal-to-noise ratio, sample by sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

HOP, HALF, REACH = 160, 200, 5


def ratio_db(speech: NDArray[np.floating], noise: NDArray[np.floating]) -> float:
    """Return the ratio of powers in dB over the 10 ms around the frames that are loud in the speech.

    Loud: the log energy of 25 ms, averaged over the 11 frames around, exceeds the mean of its 10th and 95th percentile.
    """
    signal = [float(value) for value in speech]
    frames = len(signal) // HOP + 1
    energy = []
    for frame in range(frames):
        window = range(frame * HOP - HALF, frame * HOP + HALF)
        energy.append(sum(signal[_reflected(index, len(signal))] ** 2 for index in window))
    floor = max(energy) * 1e-8
    log_energy = [math.log(max(value, floor)) for value in energy]
    smooth = [
        sum(log_energy[min(max(near, 0), frames - 1)] for near in range(frame - REACH, frame + REACH + 1)) / 11
        for frame in range(frames)
    ]
    low, high = np.quantile(smooth, 0.1), np.quantile(smooth, 0.95)
    loud = [value > (low + high) / 2 for value in smooth]
    loud_samples = [index for index in range(len(signal)) if loud[min((index + HOP // 2) // HOP, frames - 1)]]
    power = sum(signal[index] ** 2 for index in loud_samples)
    return 10 * math.log10(power / sum(float(noise[index]) ** 2 for index in loud_samples))


def _reflected(index: int, count: int) -> int:
    return -index if index < 0 else 2 * (count - 1) - index if index >= count else index
