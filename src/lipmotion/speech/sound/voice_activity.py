"""Stretches of a recording with sound in them, not too long to be recognised in one piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.loudness import loud_frames
from lipmotion.speech.features.mfcc import HOP
from lipmotion.types import Audio
from lipmotion.types.audio import sixteen_bits

LOUD_SHARE = 0.3
"""Sound is louder than this share of the way from the recording's quiet frames to its loud ones."""
SMOOTHING_FRAMES = 11
"""The energy is averaged over so many frames first."""
LEAST_FRAMES, PAUSE_FRAMES = 6, 40
"""Sound with shorter pauses is one stretch; shorter stretches are clicks."""
MARGIN_FRAMES = 30
"""Frames before and after the sound that belong to its stretch: recognisers expect a little silence."""
JOINED_FRAMES = 60
"""Stretches nearer than this, with their margins, are joined: words say more of one another than of nothing."""
LONGEST_FRAMES = 1000
"""Longer stretches are cut where they are quietest: the time of phone networks grows faster than the length."""


class Stretch(NamedTuple):
    """Frames of a recording: from ``first`` to before ``end``."""

    first: int
    end: int


def stretches_of_sound(log_energy: NDArray[np.float32]) -> list[Stretch]:
    """Return the stretches of a recording that may hold speech, in order, without overlap.

    log_energy : of every frame, natural logarithm [shape=(T,)]
    None is longer than ``LONGEST_FRAMES``. A recording of constant energy has none.
    """
    loud = np.flatnonzero(loud_frames(log_energy, SMOOTHING_FRAMES, LOUD_SHARE))
    if not len(loud):
        return []
    runs = np.split(loud, np.flatnonzero(np.diff(loud) > PAUSE_FRAMES) + 1)
    stretches: list[Stretch] = []
    for run in runs:
        first, end = int(run[0]), int(run[-1]) + 1
        if end - first < LEAST_FRAMES:
            continue
        earliest = stretches[-1].end if stretches else 0
        stretch = Stretch(max(earliest, first - MARGIN_FRAMES), min(len(log_energy), end + MARGIN_FRAMES))
        if (
            stretches
            and stretch.first - earliest <= JOINED_FRAMES
            and stretch.end - stretches[-1].first <= LONGEST_FRAMES
        ):
            stretches[-1] = Stretch(stretches[-1].first, stretch.end)
        else:
            stretches += _cut(stretch, log_energy)
    return stretches


def _cut(stretch: Stretch, log_energy: NDArray[np.float32]) -> list[Stretch]:
    """Return a stretch in pieces of at most ``LONGEST_FRAMES``, cut in the quietest frames of their second halves."""
    first, end = stretch
    pieces = []
    while end - first > LONGEST_FRAMES:
        half = first + LONGEST_FRAMES // 2
        cut = half + int(np.argmin(_smooth(log_energy[half : first + LONGEST_FRAMES])))
        pieces.append(Stretch(first, cut))
        first = cut
    return [*pieces, Stretch(first, end)]


def _smooth(log_energy: NDArray[np.float32]) -> NDArray[np.float32]:
    padded = np.pad(log_energy, SMOOTHING_FRAMES // 2, "edge")
    return np.convolve(padded, np.full(SMOOTHING_FRAMES, 1 / SMOOTHING_FRAMES), "valid").astype(np.float32)


def stretch_samples(audio: Audio, stretch: Stretch) -> bytes:
    """Return the samples of a stretch of a recording at 16 kHz, as 16-bit integers."""
    return sixteen_bits(audio.samples[stretch.first * HOP : stretch.end * HOP]).astype("<i2").tobytes()
