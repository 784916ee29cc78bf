"""Joining pieces of recordings by waveform-similarity overlap-add.

Source: W. Verhelst and M. Roelands, "An overlap-add technique based on waveform similarity (WSOLA) for high quality
time-scale modification of speech", ICASSP 1993: of the places where the next piece may begin, the one is taken at which
its waveform is most like that of the piece before. Deviation: only joins are treated; no piece is stretched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

OVERLAP_S = 0.012
"""Duration over which two pieces overlap; about one period of a low voice."""
REACH_S = 0.008
"""The next piece begins so much earlier or later, at most."""

Samples = NDArray[np.float32]


class JoinedPieces(NamedTuple):
    """Pieces of sound that were joined.

    samples : the sound [shape=(N,)]
    starts  : the number of the sample at which each piece begins, in the middle of its overlap with the one before
    shifts  : by how many samples later than wanted it begins in its recording
    """

    samples: Samples
    starts: list[int]
    shifts: list[int]


def overlapped(sounds: Sequence[Samples], pieces_s: Sequence[tuple[float, float]], rate_hz: int) -> JoinedPieces:
    """Return pieces of sounds, one after the other, which overlap where their waveforms are most alike.

    pieces_s : start and end of each piece in its recording, in seconds
    """
    half, reach = round(OVERLAP_S * rate_hz / 2), round(REACH_S * rate_hz)
    result = np.zeros(0)
    starts: list[int] = []
    shifts: list[int] = []
    for sound, (start_s, end_s) in zip(sounds, pieces_s, strict=True):
        start, end = round(start_s * rate_hz), round(end_s * rate_hz)
        if not starts:
            result = _cut(sound, start, end + half)
            starts.append(0)
            shifts.append(0)
            continue
        tail = result[-2 * half :]
        shifts.append(_best_shift(tail, sound, start - half, reach))
        start += shifts[-1]
        piece = _cut(sound, start - half, max(end, start + 1) + half)
        count = min(2 * half, len(tail), len(piece))
        fade = (1 + np.cos(np.linspace(-np.pi, 0, count))) / 2  # 0 to 1
        mixed = tail[-count:] * (1 - fade) + piece[:count] * fade
        starts.append(len(result) - half)
        result = np.concatenate([result[: len(result) - count], mixed, piece[count:]])
    return JoinedPieces(result[: max(len(result) - half, 0)].astype(np.float32), starts, shifts)


def _cut(sound: Samples, start: int, end: int) -> NDArray[np.float64]:
    """Return a part of a sound, with silence beyond its ends."""
    inside = sound[max(start, 0) : max(end, 0)].astype(float)
    return np.pad(inside, (max(-start, 0), max(end - max(start, 0) - len(inside), 0)))


def _best_shift(tail: NDArray[np.float64], sound: Samples, start: int, reach: int) -> int:
    """Return by how many samples later a piece begins so that its waveform is most like the end of the one before."""
    area = _cut(sound, start - reach, start + reach + len(tail))
    products = np.correlate(area, tail, "valid")
    energies = np.convolve(np.square(area), np.ones(len(tail)), "valid")
    likeness = products / np.sqrt(np.maximum(energies, 1e-12) * max(float(tail @ tail), 1e-12))
    shifts = np.arange(-reach, reach + 1)
    likeness -= 1e-3 * np.abs(shifts) / max(reach, 1)  # of equals, the nearest
    return int(shifts[likeness.argmax()])
