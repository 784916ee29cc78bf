"""Sampled sound, how loud and how high a voice is, and its events beside words: laughter, breath and effort."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

FULL_SCALE = 32_768
"""The 16-bit value of a sample of 1, which is one more than there is."""
LAUGHTER, BREATH, WHISPER, SHOUT = "laughter", "breath", "whisper", "shout"


@dataclass(frozen=True, eq=False)
class Audio:
    """One channel of sound.

    samples : float32 array [shape=(N,)], full scale is ±1
    rate_hz : samples per second; speech is processed at 16,000

    >>> import numpy as np
    >>> Audio(np.zeros(8_000, np.float32), 16_000).duration_s
    0.5
    """

    samples: NDArray[np.float32]
    rate_hz: int

    @property
    def duration_s(self) -> float:
        """Duration in seconds."""
        return len(self.samples) / self.rate_hz


def to_sixteen_bits(samples: NDArray[np.float32]) -> NDArray[np.int16]:
    """Return samples in 16 bits, as files hold them; what is beyond full scale is clipped."""
    return np.clip(np.rint(samples * FULL_SCALE), -FULL_SCALE, FULL_SCALE - 1).astype(np.int16)


def from_sixteen_bits(values: NDArray[np.int16]) -> NDArray[np.float32]:
    """Return the samples that 16-bit values stand for; they become the same values again."""
    return values.astype(np.float32) / np.float32(FULL_SCALE)


@dataclass(frozen=True, eq=False)
class Prosody:
    """Loudness and pitch of speech at 100 Hz; frame n is centred at n · 10 ms.

    level_db : power of the sound in decibels; the reference does not matter [shape=(T,)]
    log_f0   : natural logarithm of F0 in Hz, NaN in unvoiced frames [shape=(T,)]
    """

    level_db: NDArray[np.floating[Any]]
    log_f0: NDArray[np.floating[Any]]


@dataclass(frozen=True)
class VoiceEvent:
    """Something detected in a voice beside its words (``speech.features.voice_events``).

    start_s, end_s : seconds
    kind     : ``LAUGHTER`` (a bout), ``BREATH`` (drawn in, in a pause), ``WHISPER`` or ``SHOUT`` (a phrase)
    strength : 0 to 1: how sure laughter and whispering are; of a breath, how far it stands out of the noise of the
               recording; of a shout, how far it is from the recording's other phrases
    calls    : of laughter, the time in seconds of each "ha", and its loudness beside the loudest one, 0 to 1: half of
               it 10 dB lower
    """

    start_s: float
    end_s: float
    kind: str
    strength: float
    calls: tuple[tuple[float, float], ...] = ()

    def shifted(self, offset_s: float) -> VoiceEvent:
        """Return the event with ``offset_s`` seconds added to all times."""
        calls = tuple((time_s + offset_s, loudness) for time_s, loudness in self.calls)
        return replace(self, start_s=self.start_s + offset_s, end_s=self.end_s + offset_s, calls=calls)
