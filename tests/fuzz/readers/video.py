"""Videos: their pictures, and the nominal frame rate."""

import math
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from fuzz.inputs import Files, Good
from fuzz.plausible import require
from lipmotion_faces.tracking.frames import find_nominal_rate, open_video
from speech.sounds import tone, write_pictures, write_sound

CODECS = {
    **{"mp4": ("libx264", "yuv420p"), "mkv": ("libx264", "yuv420p"), "webm": ("libvpx", "yuv420p")},
    **{
        "avi": ("mpeg4", "yuv420p"),
        "gif": ("gif", "rgb8"),
        "mov": ("mjpeg", "yuvj420p"),
        "mpg": ("mpeg2video", "yuv420p"),
    },
    **{"ts": ("mpeg2video", "yuv420p"), "y4m": ("rawvideo", "yuv420p")},
}
FRAMES = 6
MAX_PIXELS = 1 << 26
"""Twice those of the largest video that anybody records."""


def seeds(_: Good) -> list[Files]:
    """Return a few grey pictures in many containers, with varying frame times, and with sound."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        paths = [_pictures(Path(folder) / f"a.{name}", *codec) for name, codec in CODECS.items()]
        paths.append(write_pictures(Path(folder) / "long.mp4"))
        paths.append(write_sound(Path(folder) / "both.mp4", tone(16_000, 0.3), 16_000, "aac", video=True, cover=True))
        found += [{path.name: path.read_bytes()} for path in paths]
    return found


def _pictures(path: Path, codec: str, form: str) -> Path:
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, form
        for n in range(FRAMES):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 40 * n, np.uint8), format="rgb24").reformat(
                format=form
            )
            frame.pts, frame.time_base = n, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def read(folder: Path, _: Good) -> None:
    """Check every picture, and the frame rate."""
    (path,) = folder.iterdir()
    times_s: list[float] = []
    with open_video(path) as video:
        for frame in video.frames:
            height, width, colours = frame.image.shape
            require(colours == 3 and min(height, width) > 0, "a picture of another shape")
            require(height * width <= MAX_PIXELS, "a picture that is too large")
            require(math.isfinite(frame.time_s), "a picture without a time")
            times_s.append(frame.time_s)
        rate_hz = find_nominal_rate(np.array(times_s), video.stated_rates_hz)
    require(bool((np.diff(times_s) > 0).all()), "times that do not rise")
    require(0 < rate_hz < math.inf, "a frame rate that is none")
