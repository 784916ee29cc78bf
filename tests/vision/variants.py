"""A real clip made into what people record: with other frame times, cuts, neighbours and damage."""

from collections.abc import Callable, Sequence
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


def in_a_room(
    frames: Sequence[Image], size: tuple[int, int], scale: float, at: Callable[[int], tuple[float, float]]
) -> list[Image]:
    """Return the pictures, scaled, in larger ones of a width and height; in frame n their middle is ``at(n)``, px."""
    import cv2

    patches = np.random.default_rng(0).integers(60, 180, (6, 9, 3)).astype(np.uint8)
    room = cv2.GaussianBlur(cv2.resize(patches, size, interpolation=cv2.INTER_NEAREST), (0, 0), 8)
    shown = []
    for n, frame in enumerate(frames):
        x, y = at(n)
        place = np.array(
            [[scale, 0, x - scale * frame.shape[1] / 2], [0, scale, y - scale * frame.shape[0] / 2]], np.float64
        )
        mask = cv2.warpAffine(np.ones(frame.shape[:2], np.uint8), place, size)[..., None]
        body = cv2.warpAffine(frame, place, size, flags=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
        shown.append(np.where(mask > 0, body, room))
    return shown


def zoomed(frames: Sequence[Image]) -> list[Image]:
    """Return the middle of the pictures, twice as large."""
    return [np.kron(frame[100:244, 70:250], np.ones((2, 2, 1), np.uint8)) for frame in frames]


def covered(image: Image, mouth: NDArray[np.float64], reach: float) -> Image:
    """Return the picture with the like of a hand before the mouth."""
    image = image.copy()
    (x, y), half = mouth.astype(int), int(reach)
    place = slice(max(y - half, 0), y + half), slice(x - half, x + half)
    height, width = image[place].shape[:2]
    shade = np.add.outer(np.linspace(-25, 10, height), 12 * np.sin(np.linspace(0, 4 * np.pi, width)))[..., None]
    image[place] = np.clip(image[y - 2 * half, x] + shade, 0, 255)
    return image
