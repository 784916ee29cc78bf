"""Recordings in any container, made on the spot, and which of them a piece of code opens."""

import ctypes
import os
import struct
import wave
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

LEVEL = 0.25
ONSET_S = 0.3
LAYOUTS = ("", "mono", "stereo", "2.1", "quad", "5.0", "5.1", "6.1", "7.1")  # by number of channels


def tone(rate_hz: int, duration_s: float = 1.0, channels: int = 1) -> NDArray[np.float32]:
    """Return silence, from ``ONSET_S`` on 440 Hz at a quarter of full scale [shape=(channels, N)]."""
    time_s = np.arange(round(rate_hz * duration_s)) / rate_hz
    samples = LEVEL * np.sin(2 * np.pi * 440 * time_s) * (time_s >= ONSET_S)
    return np.tile(samples.astype(np.float32), (channels, 1))


def babble(rate_hz: int, duration_s: float = 2.0) -> NDArray[np.float32]:
    """Return eighty tones from 150 to 3000 Hz that swell and fade, the same sound at any rate [shape=(1, N)]."""
    random = np.random.default_rng(1)
    time_s = np.arange(round(rate_hz * duration_s)) / rate_hz
    hertz, phases = random.uniform(150, 3000, 80), random.uniform(0, 2 * np.pi, 80)
    waves = sum(np.sin(2 * np.pi * tone * time_s + phase) for tone, phase in zip(hertz, phases, strict=True))
    loudness = 0.2 + np.abs(np.sin(2 * np.pi * 1.3 * time_s) * np.sin(2 * np.pi * 2.9 * time_s + 0.5))
    return (0.02 * waves * loudness).astype(np.float32)[None]


def write_sound(
    path: Path,
    samples: NDArray[np.float32],
    rate_hz: int,
    codec: str,
    *,
    start_s: float = 0.0,
    video: bool = False,
    hole_s: tuple[float, float] = (0.0, 0.0),
    cover: bool = False,
    options: dict[str, str] | None = None,
) -> Path:
    """Write samples [shape=(channels, N)].

    video  : beside a second of pictures that begins at 0 s
    hole_s : from when to when nothing is written, the time stamps going on
    cover  : with the picture of an album
    """
    layout = LAYOUTS[len(samples)]
    with av.open(str(path), "w") as container:
        pictures = _picture_stream(container) if video else None  # all streams before the first packet
        stream: Any = container.add_stream(codec, rate=rate_hz, layout=layout, options=options or {})
        if cover:
            _add_cover(container)
        if pictures is not None:
            _add_pictures(container, pictures)
        packed = np.ascontiguousarray(samples.T).reshape(1, -1)  # PyAV cannot fill eight planes
        frame = av.AudioFrame.from_ndarray(packed, format="flt", layout=layout)
        frame.rate, frame.pts, frame.time_base = rate_hz, round(start_s * rate_hz), Fraction(1, rate_hz)
        size = stream.codec_context.frame_size or (480 if max(hole_s) else None)
        resampler = av.AudioResampler(format=stream.format.name, rate=rate_hz, layout=layout, frame_size=size)
        for part in [*resampler.resample(frame), *resampler.resample(None)]:
            if not hole_s[0] <= part.pts / rate_hz < hole_s[1]:
                container.mux(stream.encode(part))
        container.mux(stream.encode())
    return path


def write_wave(path: Path, samples: NDArray[np.integer[Any]], rate_hz: int = 16_000) -> Path:
    """Write whole numbers of 16 bits [shape=(N,) or (N, channels)] without a codec."""
    with wave.open(str(path), "wb") as file:
        file.setparams((samples.shape[1] if samples.ndim > 1 else 1, 2, rate_hz, 0, "NONE", ""))
        file.writeframes(samples.astype("<i2").tobytes())
    return path


def late_by(samples: NDArray[np.float32], original: NDArray[np.float32]) -> tuple[int, float]:
    """Return by how many samples the first is late, and how much they are alike then."""
    count = 2 ** (len(samples) + len(original)).bit_length()
    spectrum = np.fft.rfft(samples, count) * np.conj(np.fft.rfft(original, count))
    shift = int(np.fft.irfft(spectrum).argmax())
    shift -= count if shift > count // 2 else 0
    one, two = samples[max(shift, 0) :], original[max(-shift, 0) :]
    both = min(len(one), len(two))
    return shift, float(np.corrcoef(one[:both], two[:both])[0, 1])


def _add_cover(container: Any) -> None:
    stream = container.add_stream("png", rate=1)
    stream.width = stream.height = 64
    stream.pix_fmt, stream.disposition = "rgb24", av.stream.Disposition.attached_pic
    frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 90, np.uint8), format="rgb24")
    frame.pts, frame.time_base = 0, Fraction(1, 1)
    for packet in [*stream.encode(frame), *stream.encode()]:
        container.mux(packet)


def write_pictures(path: Path) -> Path:
    """Write a video without sound."""
    with av.open(str(path), "w") as container:
        _add_pictures(container, _picture_stream(container))
    return path


def _picture_stream(container: Any) -> Any:
    stream = container.add_stream("libx264", rate=25)
    stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
    return stream


def _add_pictures(container: Any, stream: Any) -> None:
    """Add a second of flat grey."""
    for n in range(25):
        frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 100, np.uint8), format="rgb24")
        frame.pts, frame.time_base = n, Fraction(1, 25)
        container.mux(stream.encode(frame))
    container.mux(stream.encode())


def write_stamped(path: Path, stamps_s: Sequence[float], rate_hz: int = 16_000) -> Path:
    """Write packets of 20 ms of a tone in 8 bits, each with the time stamp that is given, rising or not."""
    content = np.round(128 + 100 * np.sin(2 * np.pi * 440 * np.arange(rate_hz // 50) / rate_hz)).astype(np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_u8", rate=rate_hz, layout="mono")
        for number, stamp_s in enumerate(stamps_s):
            packet = av.Packet(content.tobytes())
            packet.stream, packet.time_base = stream, Fraction(1, 1000)
            packet.dts, packet.pts = number, max(round(1000 * stamp_s), number)  # the container keeps the latter
            container.mux(packet)
    return path


def write_constant_flac(path: Path, seconds: float, rates_hz: Sequence[int] = (8000,)) -> Path:
    """Write FLAC frames of 65,535 equal samples, fourteen bytes each; the last frames state the last of the rates."""
    rate_hz = rates_hz[0]
    info = (4096).to_bytes(2) + (65_535).to_bytes(2) + bytes(6) + (rate_hz << 44 | 15 << 36).to_bytes(8) + bytes(16)
    frames = max(round(seconds * rate_hz / 65_535), 2)
    stated = [rates_hz[n * len(rates_hz) // frames] for n in range(frames)]
    content = [b"fLaC\x80" + len(info).to_bytes(3) + info]
    content += [_constant_frame(number, rate) for number, rate in enumerate(stated)]
    path.write_bytes(b"".join(content))
    return path


def _constant_frame(number: int, rate_hz: int) -> bytes:
    header = b"\xff\xf8\x7d\x08" + chr(number).encode() + (65_534).to_bytes(2) + rate_hz.to_bytes(2)
    header += _crc(header, 0x07, 8).to_bytes(1)
    frame = header + b"\x00\x01\x00"
    return frame + _crc(frame, 0x8005, 16).to_bytes(2)


def _crc(content: bytes, polynomial: int, bits: int) -> int:
    value, top = 0, 1 << bits
    for byte in content:
        value ^= byte << (bits - 8)
        for _ in range(8):
            value = (value << 1) ^ (polynomial | top if value << 1 & top else 0)
    return value


OPENED = 0x20  # ``IN_OPEN`` of ``inotify``
HEADER = struct.Struct("iIII")


@contextmanager
def opened_in(folder: Path) -> Iterator[set[str]]:
    """Give a set that holds, at the end of the block, the names of the files of a folder that were opened in it."""
    names: set[str] = set()
    system = ctypes.CDLL(None, use_errno=True)
    watch = system.inotify_init1(os.O_NONBLOCK)
    try:
        assert system.inotify_add_watch(watch, os.fsencode(folder), OPENED) > 0, os.strerror(ctypes.get_errno())
        yield names
        with suppress(BlockingIOError):  # nothing was
            events, start = os.read(watch, 1 << 20), 0
            while start < len(events):
                length = HEADER.unpack_from(events, start)[3]
                start += HEADER.size + length
                names.add(os.fsdecode(events[start - length : start].rstrip(b"\0")))
    finally:
        os.close(watch)
