"""Sound in memory at 16 kHz, and joining pieces of recordings by waveform-similarity overlap-add.

Source: W. Verhelst and M. Roelands, "An overlap-add technique based on waveform similarity (WSOLA) for high quality
time-scale modification of speech", ICASSP 1993: of the places where the next piece may begin, the one is taken at which
its waveform is most like that of the piece before. Deviation: only joins are treated; no piece is stretched.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import SPEECH_RATE_HZ, Audio, to_sixteen_bits

BLOCK = 1 << 16  # samples that are resampled at a time


def resample_speech(sound: Audio) -> Audio:
    """Return sound at 16 kHz, bit by bit what ``read_audio`` returns of a ``.wav`` or ``.flac`` with its 16 bits."""
    import av

    resampler = av.AudioResampler(format="flt", layout="mono", rate=SPEECH_RATE_HZ)
    parts: list[Any] = []
    for start in range(0, len(sound.samples), BLOCK):
        block = to_sixteen_bits(sound.samples[None, start : start + BLOCK])
        frame = av.AudioFrame.from_ndarray(block, format="s16", layout="mono")
        frame.rate, frame.pts, frame.time_base = sound.rate_hz, None, Fraction(1, sound.rate_hz)
        parts += resampler.resample(frame)
    parts += resampler.resample(None)
    return Audio(np.concatenate([part.to_ndarray()[0] for part in parts]), SPEECH_RATE_HZ)


Samples = NDArray[np.float32]

OVERLAP_S = 0.012  # duration over which two pieces overlap; about one period of a low voice
REACH_S = 0.008  # the next piece begins so much earlier or later, at most


class JoinedPieces(NamedTuple):
    """Pieces of sound that were joined."""

    samples: Samples  # the sound [shape=(N,)]
    starts: list[int]  # sample at which each piece begins, in the middle of its overlap with the one before
    shifts: list[int]  # by how many samples later than wanted it begins in its recording


def overlap_pieces(sounds: Sequence[Samples], pieces_s: Sequence[tuple[float, float]], rate_hz: int) -> JoinedPieces:
    """Return pieces of sounds, one after the other, which overlap where their waveforms are most alike.

    pieces_s : start and end of each piece in its recording, in seconds
    """
    half, reach = round(OVERLAP_S * rate_hz / 2), round(REACH_S * rate_hz)
    result, starts, shifts = np.zeros(0), list[int](), list[int]()
    for sound, (start_s, end_s) in zip(sounds, pieces_s, strict=True):
        start, end = round(start_s * rate_hz), round(end_s * rate_hz)
        if not starts:
            result = _cut(sound, start, end + half)
            starts.append(0)
            shifts.append(0)
            continue
        tail = result[-2 * half :]
        area = _cut(sound, start - half - reach, start - half + reach + len(tail))
        energies = np.convolve(np.square(area), np.ones(len(tail)), "valid")
        likeness = np.correlate(area, tail, "valid")
        likeness /= np.sqrt(np.maximum(energies, 1e-12) * max(float(tail @ tail), 1e-12))
        likeness -= 1e-3 * np.abs(np.arange(-reach, reach + 1)) / max(reach, 1)  # of equals, the nearest
        shifts.append(int(likeness.argmax()) - reach)
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
