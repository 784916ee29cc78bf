"""Signal-to-noise ratio, sample by sample."""

import math

import numpy as np
from numpy.typing import NDArray

HOP, HALF, REACH = 160, 200, 5
DECIBEL = math.log(10) / 10


def ratio_db(speech: NDArray[np.floating], noise: NDArray[np.floating]) -> float:
    """Return the ratio of powers in dB over the 10 ms around the frames that are loud in the speech.

    Loud: the log energy of 25 ms, averaged over the 11 frames around, is less than 20 dB beneath the loudest quarter of
    a second, and exceeds the noise by 6 dB or 30 % of the way to that. The noise: of the lowest energies within a
    second before and after, the higher one; the median of these in frames less than 20 dB beneath the loudest.
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
    powers = [math.exp(value) for value in log_energy]
    loudest = max(math.log(sum(powers[max(n - 12, 0) : n + 13]) / 25) for n in range(frames))
    beneath = [max(min(smooth[max(n - 100, 0) : n + 1]), min(smooth[n : n + 101])) for n in range(frames)]
    room = float(np.median([beneath[n] for n in range(frames) if smooth[n] > loudest - 20 * DECIBEL]))
    threshold = max(loudest - 20 * DECIBEL, room + min(6 * DECIBEL, 0.3 * (loudest - room)))
    loud = [value > threshold for value in smooth]
    loud_samples = [index for index in range(len(signal)) if loud[min((index + HOP // 2) // HOP, frames - 1)]]
    power = sum(signal[index] ** 2 for index in loud_samples)
    return 10 * math.log10(power / sum(float(noise[index]) ** 2 for index in loud_samples))


def _reflected(index: int, count: int) -> int:
    return -index if index < 0 else 2 * (count - 1) - index if index >= count else index
