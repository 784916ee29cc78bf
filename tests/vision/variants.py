"""A real clip made into what people record: with other frame times, cuts, neighbours and damage."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def frames_of(path: Path) -> list[Image]:
    """Return every picture of a video."""
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def write_frames(
    path: Path,
    frames: Sequence[Image],
    *,
    ticks: Sequence[int] | None = None,
    rate: int = 25,
    codec: str = "libx264",
    options: dict[str, str] | None = None,
    rotation: int = 0,
    pixel_shape: tuple[int, int] = (1, 1),
) -> Path:
    """Write pictures; ``ticks`` are their times in 1/``rate`` s, by default one after the other."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options={"crf": "8"} if options is None else options)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        stream.codec_context.time_base = Fraction(1, rate)
        stream.codec_context.sample_aspect_ratio = Fraction(*pixel_shape)
        if codec == "mpeg2video":
            stream.bit_rate = 6_000_000
        if rotation:
            stream.set_display_rotation(rotation)
        for n, image in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame.pts, frame.time_base = n if ticks is None else ticks[n], Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def covered(image: Image, mouth: NDArray[np.float64], reach: float) -> Image:
    """Return the picture with the like of a hand before the mouth."""
    image = image.copy()
    (x, y), half = mouth.astype(int), int(reach)
    place = slice(max(y - half, 0), y + half), slice(x - half, x + half)
    height, width = image[place].shape[:2]
    shade = np.add.outer(np.linspace(-25, 10, height), 12 * np.sin(np.linspace(0, 4 * np.pi, width)))[..., None]
    image[place] = np.clip(image[y - 2 * half, x] + shade, 0, 255)
    return image
