"""Signal-to-noise ratio, sample by sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

HOP, HALF, REACH = 160, 200, 5


def ratio_db(speech: NDArray[np.floating], noise: NDArray[np.floating]) -> float:
    """Return the ratio of powers in dB over the 10 ms around the frames that are loud in the speech.

    Loud: the log energy of 25 ms, averaged over the 11 frames around, is past the middle between its 10th and its
    95th percentile.
    """
    signal = [float(value) for value in speech]
    frames = len(signal) // HOP + 1
    energy = []
    for frame in range(frames):
        around = range(frame * HOP - HALF, frame * HOP + HALF)
        energy.append(sum(signal[_reflected(place, len(signal))] ** 2 for place in around))
    floor = max(energy) * 1e-8
    log_energy = [math.log(max(value, floor)) for value in energy]
    smooth = [
        sum(log_energy[min(max(near, 0), frames - 1)] for near in range(frame - REACH, frame + REACH + 1)) / 11
        for frame in range(frames)
    ]
    low, high = np.quantile(smooth, 0.1), np.quantile(smooth, 0.95)
    loud = [value > (low + high) / 2 for value in smooth]
    heard = [place for place in range(len(signal)) if loud[min((place + HOP // 2) // HOP, frames - 1)]]
    power = sum(signal[place] ** 2 for place in heard)
    return 10 * math.log10(power / sum(float(noise[place]) ** 2 for place in heard))


def _reflected(place: int, count: int) -> int:
    return -place if place < 0 else 2 * (count - 1) - place if place >= count else place
