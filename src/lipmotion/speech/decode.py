"""One sound track of an open container to one channel, every sample at its time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.files import moving_pictures

HOLE_S = 0.04
"""A frame this much later than the end of the one before leaves a hole; time stamps are rounded to 1 ms or better."""
LONGEST_HOLE_S = 600.0
"""Time stamps that jump further are wrong."""


@dataclass(frozen=True, eq=False)
class Decoded:
    """What a sound track holds.

    samples     : float32 array [shape=(N,)]
    rate_hz     : of the samples
    energies    : of every channel
    mean_energy : of the channels' mean
    packets     : of the track
    damaged     : packets that could not be decoded
    silence_s   : put in for holes
    stated_s    : duration that the container states, 0 if none
    """

    samples: NDArray[np.float32]
    rate_hz: int
    energies: tuple[float, ...]
    mean_energy: float
    packets: int
    damaged: int
    silence_s: float
    stated_s: float


def decode(container: Any, rate_hz: int, channel: int | None = None) -> Decoded:
    """Return the first sound track of an open container.

    channel : the one to take; None: the mean of all
    Time 0 is the container's start; in a file without moving pictures, the first sample.
    Raises InputError: time stamps that jump by more than ``LONGEST_HOLE_S``.
    """
    return _Track(container, rate_hz, channel).decoded()


class _Track:
    """The decoding of one track; what came out so far is in ``_bytes``, which grows in place."""

    def __init__(self, container: Any, rate_hz: int, channel: int | None) -> None:
        self._container = container
        self._stream = container.streams.audio[0]
        self._rate_hz, self._channel = rate_hz, channel
        self._bytes = bytearray()
        self._resampler: Any = None
        self._form: tuple[Any, ...] = ()
        self._layout: Any = None
        self._cut = 0
        self._clock_s: float | None = None
        self._energies: NDArray[np.float64] | float = 0.0
        self._mean_energy = 0.0
        self._silence_s = 0.0
        self._packets = self._damaged = 0

    def decoded(self) -> Decoded:
        for frame in self._frames():
            self._place(frame)
            self._resample(frame)
        self._flush()
        return Decoded(
            samples=np.frombuffer(self._bytes, np.float32)[self._cut :],
            rate_hz=self._rate_hz,
            energies=tuple(np.atleast_1d(self._energies).tolist()),
            mean_energy=self._mean_energy,
            packets=self._packets,
            damaged=self._damaged,
            silence_s=self._silence_s,
            stated_s=self._stated_s(),
        )

    def _stated_s(self) -> float:
        if self._stream.duration:
            return float(self._stream.duration * self._stream.time_base)
        return 0.0 if self._container.streams.video else (self._container.duration or 0) / 1e6

    def _frames(self) -> Iterator[Any]:
        """Yield what can be decoded; damaged packets are counted."""
        import av

        for packet in self._container.demux(self._stream):
            self._packets += packet.size > 0
            try:
                yield from packet.decode()
            except av.FFmpegError:
                self._damaged += 1

    def _place(self, frame: Any) -> None:
        """Put silence where no sound was decoded."""
        if frame.pts is not None:
            time_s = float(frame.pts * frame.time_base)
            if self._clock_s is None:
                self._start(time_s)
            elif time_s - self._clock_s > HOLE_S:
                self._flush()
                self._silence_s += time_s - self._clock_s
                self._add_silence(time_s - self._clock_s)
            if self._clock_s is None or abs(time_s - self._clock_s) > HOLE_S:
                self._clock_s = time_s
        if self._clock_s is not None:
            self._clock_s += frame.samples / frame.sample_rate

    def _start(self, time_s: float) -> None:
        has_pictures = bool(moving_pictures(self._container))
        offset_s = time_s - (self._container.start_time or 0) / 1e6 if has_pictures else 0.0
        self._add_silence(max(offset_s, 0.0))
        self._cut = max(round(-offset_s * self._rate_hz), 0)

    def _add_silence(self, duration_s: float) -> None:
        if duration_s > LONGEST_HOLE_S:
            raise InputError(
                f"{self._container.name.removeprefix('file:')}: the time stamps of its sound jump by {duration_s:.0f} "
                f"s, at most {LONGEST_HOLE_S:.0f} s are bridged; export the recording again"
            )
        self._bytes += bytes(4 * round(duration_s * self._rate_hz))

    def _resample(self, frame: Any) -> None:
        import av

        form = (frame.format.name, frame.layout.name, frame.sample_rate)
        if self._resampler is None or form != self._form:  # tracks joined end to end may change
            self._flush()
            self._form, self._layout = form, self._layout or frame.layout.name
            self._resampler = av.AudioResampler(format="flt", layout=self._layout, rate=self._rate_hz)
        frame.pts = None
        self._add(self._resampler.resample(frame))

    def _flush(self) -> None:
        if self._resampler is not None:
            self._add(self._resampler.resample(None))
        self._resampler = None

    def _add(self, frames: list[Any]) -> None:
        for frame in frames:
            # packed, not planar: PyAV reads beyond the planes of eight channels
            channels = frame.to_ndarray().reshape(frame.samples, -1)
            with np.errstate(all="ignore"):  # what is not finite, or beyond all bounds, is refused when all is decoded
                mean = channels.mean(axis=1)
                self._energies = self._energies + np.square(channels, dtype=np.float64).sum(axis=0)
                self._mean_energy += float(np.square(mean, dtype=np.float64).sum())
            chosen = mean if self._channel is None else channels[:, self._channel]
            self._bytes += np.ascontiguousarray(chosen).data
