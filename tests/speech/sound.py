"""Recordings in any container, made on the spot."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

LEVEL = 0.25
ONSET_S = 0.3


def tone(rate_hz: int, duration_s: float = 1.0, channels: int = 1) -> NDArray[np.float32]:
    """Return silence, from ``ONSET_S`` on 440 Hz at a quarter of full scale [shape=(channels, N)]."""
    time_s = np.arange(round(rate_hz * duration_s)) / rate_hz
    samples = LEVEL * np.sin(2 * np.pi * 440 * time_s) * (time_s >= ONSET_S)
    return np.tile(samples.astype(np.float32), (channels, 1))


def write_sound(
    path: Path, samples: NDArray[np.float32], rate_hz: int, codec: str, *, start_s: float = 0.0, video: bool = False
) -> Path:
    """Write samples [shape=(channels, N)]; with ``video``, beside a second of pictures that begins at 0 s."""
    layout = "stereo" if len(samples) == 2 else "mono"
    with av.open(str(path), "w") as container:
        pictures = _picture_stream(container) if video else None  # all streams before the first packet
        stream: Any = container.add_stream(codec, rate=rate_hz, layout=layout)
        if pictures is not None:
            _add_pictures(container, pictures)
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(samples), format="fltp", layout=layout)
        frame.rate, frame.pts, frame.time_base = rate_hz, round(start_s * rate_hz), Fraction(1, rate_hz)
        size = stream.codec_context.frame_size or None
        resampler = av.AudioResampler(format=stream.format.name, rate=rate_hz, layout=layout, frame_size=size)
        for part in [*resampler.resample(frame), *resampler.resample(None)]:
            container.mux(stream.encode(part))
        container.mux(stream.encode())
    return path


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
