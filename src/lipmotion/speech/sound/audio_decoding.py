"""Decoding of a container's sound track to one channel, with every sample at its time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.media import stated_duration_s, video_streams

HOLE_S = 0.04
"""A frame this much later than the end of the one before leaves a hole; time stamps are rounded to 1 ms or better."""
LONGEST_HOLE_S = 600.0
"""A hole longer than this means that the time stamps are wrong."""
MOST_SILENCE_RATIO = 20.0
"""All holes together may last as long as the longest one allowed, and this many times the sound: a codec that sends
nothing in pauses still sends 20 ms of every 400. More silence than that is no recording, but would fill the memory."""
LEAST_BYTES_PER_S = 20.0
"""Bytes of the file that every second takes at least, not counting as long as the longest hole allowed: no codec for
speech needs less than 56, digital silence in FLAC 27. A small file must not fill the memory with sound."""
LOWEST_HZ, HIGHEST_HZ = 4000, 1_000_000
"""Lowest and highest sampling rate: below, speech is not intelligible; no recorder samples at a higher one."""
MOST_CHANNELS = 64
PIECE_BYTES = 1 << 20
"""Sound is collected in pieces of this size, and without digital silence."""


@dataclass(frozen=True, eq=False)
class DecodedAudio:
    """A decoded sound track.

    samples     : float32 array [shape=(N,)]
    rate_hz     : sampling rate
    energies    : energy of every channel
    mean_energy : energy of the channels' mean
    packets     : how many packets the track has
    damaged     : how many of them could not be decoded
    silence_s   : duration of the silence that fills holes
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


def decode_audio(container: Any, rate_hz: int, channel: int | None = None) -> DecodedAudio:
    """Return the decoded first sound track of an open container.

    channel : number of the channel to take; None: the mean of all channels
    Time 0 is the container's start; in a file without moving pictures, the first sample.
    Digital silence, and that which fills holes, is left out until the end: memory that nobody writes to costs nothing.
    Raises InputError: time stamps that jump by more than ``LONGEST_HOLE_S``, or leave more silence than
    ``MOST_SILENCE_RATIO`` allows; more sound than the bytes of the track can hold; a rate or a number of channels that
    no recorder has.
    """
    return _TrackDecoder(container, rate_hz, channel).decoded()


def check_sound_format(name: str, rate_hz: int, channels: int) -> None:
    """Raise InputError for a sampling rate or a number of channels that no recorder has.

    A wrong header could fill the memory: at a rate of 1 Hz, 16,000 samples are made out of one.
    """
    if not LOWEST_HZ <= rate_hz <= HIGHEST_HZ:
        raise InputError(
            f"{name}: sampled at {rate_hz} Hz, required {LOWEST_HZ} to {HIGHEST_HZ}; export the recording again"
        )
    if not 1 <= channels <= MOST_CHANNELS:
        raise InputError(f"{name}: has {channels} channels, required 1 to {MOST_CHANNELS}; export the recording again")


class _TrackDecoder:
    """Decodes one track; the sound so far is in ``_pieces``, each with the number of samples before it."""

    def __init__(self, container: Any, rate_hz: int, channel: int | None) -> None:
        self._container = container
        self._name = container.name.removeprefix("file:")
        self._stream = container.streams.audio[0]
        self._rate_hz, self._channel = rate_hz, channel
        self._pieces = [(0, bytearray())]
        self._count = 0
        self._resampler: Any = None
        self._form: tuple[Any, ...] = ()
        self._layout: Any = None
        self._cut = 0
        self._clock_s: float | None = None
        self._energies: NDArray[np.float64] | float = 0.0
        self._mean_energy = 0.0
        self._silence_s = self._sound_s = 0.0
        self._packets = self._damaged = self._size = 0

    def decoded(self) -> DecodedAudio:
        """Return the decoded track; can be called once."""
        for frame in self._frames():
            check_sound_format(self._name, frame.sample_rate, frame.layout.nb_channels)
            self._sound_s += frame.samples / frame.sample_rate
            self._check_length(self._sound_s)
            self._place(frame)
            self._resample(frame)
        self._flush()
        self._check_silence()
        samples = np.zeros(self._count, np.float32)
        while self._pieces:  # each is freed when it is copied
            first, piece = self._pieces.pop()
            samples[first : first + len(piece) // 4] = np.frombuffer(piece, np.float32)
        return DecodedAudio(
            samples=samples[self._cut :],
            rate_hz=self._rate_hz,
            energies=tuple(np.atleast_1d(self._energies).tolist()),
            mean_energy=self._mean_energy,
            packets=self._packets,
            damaged=self._damaged,
            silence_s=self._silence_s,
            stated_s=self._stated_s(),
        )

    def _stated_s(self) -> float:
        if self._container.streams.video and not self._stream.duration:
            return 0.0
        return stated_duration_s(self._container, self._stream)

    def _frames(self) -> Iterator[Any]:
        """Yield the frames that can be decoded; damaged packets are counted."""
        import av

        for packet in self._container.demux(self._stream):
            self._packets += packet.size > 0
            self._size += packet.size
            try:
                yield from packet.decode()
            except av.FFmpegError:
                self._damaged += 1

    def _place(self, frame: Any) -> None:
        """Note a hole before a frame that starts later than the one before it ended."""
        if frame.pts is not None:
            time_s = float(frame.pts * frame.time_base)
            if self._clock_s is None:
                self._start(time_s)
            elif time_s - self._clock_s > HOLE_S:
                self._flush()
                self._silence_s += time_s - self._clock_s
                self._count += self._silence(time_s - self._clock_s)
            if self._clock_s is None or abs(time_s - self._clock_s) > HOLE_S:
                self._clock_s = time_s
        if self._clock_s is not None:
            self._clock_s += frame.samples / frame.sample_rate

    def _start(self, time_s: float) -> None:
        has_pictures = bool(video_streams(self._container))
        offset_s = time_s - (self._container.start_time or 0) / 1e6 if has_pictures else 0.0
        self._count += self._silence(max(offset_s, 0.0))
        self._cut = max(round(-offset_s * self._rate_hz), 0)

    def _silence(self, duration_s: float) -> int:
        """Return the number of samples of a hole's silence. Raises InputError: the hole is too long."""
        if duration_s > LONGEST_HOLE_S:
            raise InputError(
                f"{self._name}: the time stamps of its sound jump by {duration_s:.0f} s, at most "
                f"{LONGEST_HOLE_S:.0f} s are bridged; export the recording again"
            )
        return round(duration_s * self._rate_hz)

    def _check_silence(self) -> None:
        most_s = LONGEST_HOLE_S + MOST_SILENCE_RATIO * self._sound_s
        if self._silence_s > most_s:
            raise InputError(
                f"{self._name}: the time stamps of its sound leave holes of {self._silence_s:.0f} s beside "
                f"{self._sound_s:.1f} s of sound, at most {most_s:.0f} s are bridged; export the recording again"
            )
        self._check_length(self._sound_s + self._silence_s)

    def _check_length(self, length_s: float) -> None:
        most_s = LONGEST_HOLE_S + self._size / LEAST_BYTES_PER_S
        if length_s > most_s:
            raise InputError(
                f"{self._name}: {self._size} bytes of sound last {length_s:.0f} s, required at most {most_s:.0f} s "
                f"({LEAST_BYTES_PER_S:.0f} bytes a second); export the recording again"
            )

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
            with np.errstate(all="ignore"):  # samples that are not finite are refused when all is decoded
                mean = channels.mean(axis=1)
                self._energies = self._energies + np.square(channels, dtype=np.float64).sum(axis=0)
                self._mean_energy += float(np.square(mean, dtype=np.float64).sum())
            chosen = mean if self._channel is None else channels[:, self._channel]
            if chosen.any():
                first, piece = self._pieces[-1]
                if first + len(piece) // 4 < self._count or len(piece) > PIECE_BYTES:
                    piece = bytearray()
                    self._pieces.append((self._count, piece))
                piece += np.ascontiguousarray(chosen).data
            self._count += len(chosen)
