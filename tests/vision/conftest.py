from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

WriteVideo = Callable[..., Path]


@pytest.fixture
def write_video(tmp_path: Path) -> WriteVideo:
    """Writes a video whose frame n is a flat grey of value 10 · n."""

    def write(
        name: str = "clip.mp4",
        ticks: Sequence[int] = range(10),
        rate: int = 25,
        size: tuple[int, int] = (64, 48),
        rotation: int = 0,
        picture: NDArray[np.uint8] | None = None,
        pixel_shape: tuple[int, int] = (1, 1),
        codec: str = "libx264",
    ) -> Path:
        from fractions import Fraction

        import av

        path = tmp_path / name
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=rate, options={"qp": "0"})
            stream.width, stream.height = size
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            stream.codec_context.time_base = Fraction(1, rate)
            stream.codec_context.sample_aspect_ratio = Fraction(*pixel_shape)
            if rotation:
                stream.set_display_rotation(rotation)
            for n, tick in enumerate(ticks):
                image = np.full((size[1], size[0], 3), 10 * n % 256, np.uint8) if picture is None else picture
                frame = av.VideoFrame.from_ndarray(image, format="rgb24")
                frame.pts, frame.time_base = tick, Fraction(1, rate)
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        return path

    return write
