"""The sound of a stream: pieces of any length and rate, brought to one channel at 16 kHz."""

from __future__ import annotations

from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ

TAPS, BLOCK = 16, 160
"""Zero crossings of the resampling filter on either side; and samples that are resampled at a time, 10 ms."""


class Resampler:
    """Sound at 16 kHz, block by block, with a windowed sinc (Kaiser); how it is cut into pieces changes no bit."""

    def __init__(self, rate_hz: int) -> None:
        shared = gcd(rate_hz, SPEECH_RATE_HZ)
        self._up, self._down, self._rate_hz = SPEECH_RATE_HZ // shared, rate_hz // shared, rate_hz
        slower = max(1.0, rate_hz / SPEECH_RATE_HZ)
        self._reach = int(np.ceil(TAPS * slower))
        x = np.arange(1 - self._reach, self._reach + 1) - np.arange(self._up)[:, None] / self._up
        window = np.i0(8.0 * np.sqrt(np.maximum(1 - np.square(x / self._reach), 0))) / np.i0(8.0)
        self._filters = (np.sinc(0.95 * x / slower) * 0.95 / slower * window).astype(np.float32)
        self._pending = np.zeros(self._reach - 1, np.float32)  # beginning at the sample ``_reach`` - 1 before the next
        self._made, self._taken, self.pushed = 0, 0, 0

    @property
    def seconds(self) -> float:
        """Seconds of sound that were pushed."""
        return self.pushed / self._rate_hz

    def push(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return what is known of the sound at 16 kHz now."""
        self.pushed += len(samples)
        if self._up == self._down:
            return samples
        self._pending = np.concatenate([self._pending, samples])
        blocks = []
        while True:
            numbers = np.arange(self._made, self._made + BLOCK)
            first, phase = np.divmod(numbers * self._down, self._up)
            if first[-1] - self._taken + 2 * self._reach > len(self._pending):
                break
            rows = self._pending[(first - self._taken)[:, None] + np.arange(2 * self._reach)]
            blocks.append(np.einsum("nt,nt->n", rows, self._filters[phase]))
            self._made += BLOCK
            drop = int(first[-1]) - self._taken
            self._pending, self._taken = self._pending[drop:], self._taken + drop
        return np.concatenate([*blocks, np.zeros(0, np.float32)])

    def finish(self) -> NDArray[np.float32]:
        """Return the rest, with silence after it."""
        seconds = self.seconds
        pushed, rest = self.pushed, self.push(np.zeros(2 * self._reach + self._rate_hz // 50, np.float32))
        self.pushed = pushed
        return rest[: max(int(np.ceil(seconds * SPEECH_RATE_HZ)) - (self._made - len(rest)), 0)]


def mono_samples(samples: Any) -> NDArray[np.float32]:
    """Return samples as floats of one channel, full scale 1. Raises InputError: as ``Stream.push``."""
    if isinstance(samples, bytes | bytearray | memoryview):
        if len(samples) % 2:
            raise InputError(f"{len(samples)} bytes of sound, required whole samples of 16 bits")
        samples = np.frombuffer(samples, "<i2")
    values = np.asarray(samples)
    if (
        values.ndim not in (1, 2)
        or values.dtype.kind not in "if"
        or (values.dtype.kind == "i" and values.itemsize != 2)
    ):
        raise InputError(
            f"samples of shape {values.shape} and type {values.dtype}, required (N,) or (N, C), floats or int16"
        )
    floats = values.astype(np.float32) / np.float32(32768) if values.dtype.kind == "i" else values.astype(np.float32)
    if not np.isfinite(floats).all():
        raise InputError("samples that are not finite; leave them out, or put 0 there")
    return floats.mean(axis=1, dtype=np.float32) if floats.ndim == 2 else floats
