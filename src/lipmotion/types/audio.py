"""Sampled sound, its acoustic features, how loud and how high a voice is, and its events beside words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types.timeline import Span

SPEECH_RATE_HZ = 16_000  # of all speech that is analysed
FULL_SCALE = 32_768  # the 16-bit value of a sample of 1, which is one more than there is
LAUGHTER, BREATH = "laughter", "breath"


@dataclass(frozen=True, eq=False)
class Audio:
    """One channel of sound.

    samples : float32 array [shape=(N,)], full scale is ±1
    rate_hz : samples per second; speech is processed at 16,000
    Raises InputError: other samples, as integers or of several channels; no rate.

    >>> import numpy as np
    >>> Audio(np.zeros(8_000, np.float32), 16_000).duration_s
    0.5
    """

    samples: NDArray[np.float32]
    rate_hz: int

    def __post_init__(self) -> None:
        samples = self.samples
        is_array = isinstance(samples, np.ndarray) and not np.ma.is_masked(samples)
        if not is_array or samples.dtype.kind != "f" or samples.ndim != 1:
            found = f"{samples.dtype} {samples.shape}" if is_array else type(samples).__name__
            how = f"divide integers of 16 bits by {FULL_SCALE}, take the mean of channels"
            raise InputError(f"the samples are {found}, required a NumPy array of floats of shape (N,); {how}")
        if isinstance(self.rate_hz, str | None) or not self.rate_hz > 0:
            raise InputError(f"the samples are of {self.rate_hz!r} Hz, required a number over 0")

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
    """Something detected in a voice beside its words (``speech.sound.voice_events``).

    start_s, end_s : seconds
    kind     : ``LAUGHTER`` (a bout) or ``BREATH`` (drawn in, in a pause)
    strength : 0 to 1: how sure laughter is; of a breath, how far it stands out of the noise of the recording
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


FRAME_RATE_HZ = 100.0  # frames per second of all models; frame n is centred at n / FRAME_RATE_HZ seconds
ENERGY_FEATURE = 12  # the acoustic feature that is the log energy
SPECTRUM_BANDS = 40  # mel bands of a spectrum, the input of acoustic networks


@dataclass(frozen=True, eq=False)
class Features:
    """Acoustic features of one recording: mel-frequency cepstral coefficients with Δ and Δ².

    values     : float32 array [shape=(T, 39)], normalised per recording; frame n is centred at n / 100 seconds
    duration_s : duration of the recording in seconds; T = floor(duration_s * 100) + 1
    """

    values: NDArray[np.float32]
    duration_s: float


@dataclass(frozen=True, eq=False)
class TokenPosteriors:
    """Posteriors of the tokens of a phone recogniser in a recording.

    values : float16 array [shape=(ceil(T / 2), K)], natural logarithms; row n is centred at n / 50 seconds
    source : name, version and digest of the recogniser
    mean   : the mean posterior of the phones that it finds, 0 to 1: how sure it is of them
    """

    values: NDArray[np.float16]
    source: str
    mean: float


class JoinedRows:
    """Rows of a whole recording, some of which are one row in memory, as those of hours of silence.

    It is used as an array, which takes the memory of all rows: ``np.asarray(rows)``, or of some: ``rows[first:stop]``.
    """

    def __init__(self, parts: Sequence[NDArray[Any]]) -> None:
        self._parts = parts
        self.shape = (sum(map(len, parts)), *parts[0].shape[1:])
        self.dtype = parts[0].dtype

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        first, stop, _ = rows.indices(len(self))
        starts = np.cumsum([0, *map(len, self._parts)]).tolist()
        pairs = zip(self._parts, starts, strict=False)
        return np.concatenate([part[max(first - start, 0) : max(stop - start, 0)] for part, start in pairs])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return self[:].astype(dtype or self.dtype, copy=False)

    def any(self) -> bool:
        """Return whether a value is not 0."""
        return any(part.any() for part in self._parts)


def frame_of(time_s: float, frames: int, rate_hz: float) -> int | None:
    """Return the frame nearest to a time in a recording of so many frames at ``rate_hz``; None: it is outside."""
    frame = np.floor(time_s * rate_hz + 0.5)
    return int(frame) if 0 <= frame < frames else None


def frames_of(span: Span[Any], frames: int) -> tuple[int, int]:
    """Return the first frame of a span at 100 Hz and the one after its last, both cut to so many frames."""
    first, stop = (ceil(min(max(s * FRAME_RATE_HZ - 1e-6, 0), frames)) for s in (span.start_s, span.end_s))
    return first, stop
