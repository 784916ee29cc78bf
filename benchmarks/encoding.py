"""Settings of the H.264 encoder: time, size and likeness of what ``write_mp4`` writes.

    python benchmarks/encoding.py [--corpora ../shared/corpora] [--frames 75]

Frames of the first clips of ``val``: as they are (360 × 288), and enlarged to 1280 × 720 with the noise of a camera (a
normal deviation of 0.7 and of 2 grey levels a colour). Prints a JSON object for each kind of frames and settings:
cpu_ms : processor time of all threads a frame, conversion of colours and file included
kB     : size a frame
psnr   : of the luma, mean of the frames, dB; least: of any frame; flat: of the 40 % of the pixels with the least detail
flicker, gradient : mean absolute second difference in time, and gradient energy, relative to the given frames
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Audio
from lipmotion_faces.tracking.frames import open_video
from lipmotion_faces.video import mp4 as video

Picture = NDArray[np.uint8]
CABAC = "cabac=1:deblock=0,0:8x8dct=1"
SETTINGS = {
    "chosen": {},
    "veryfast (before)": {"preset": "veryfast", "x264-params": "bframes=3"},
    "veryfast, bframes=0": {"preset": "veryfast"},
    "superfast": {"x264-params": "mbtree=0"},
    "superfast, crf=21": {"x264-params": "mbtree=0", "crf": "21"},
    "ultrafast, crf=20": {"preset": "ultrafast", "crf": "20", "x264-params": "mbtree=0"},
    "ultrafast, CABAC, crf=19": {"preset": "ultrafast", "crf": "19", "x264-params": CABAC},
}
"""Changes of the settings of ``write_mp4``."""
WARM_UP = 10
"""Frames at the beginning that likeness leaves out."""


def main() -> None:
    """Print one JSON object for each kind of frames and settings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--frames", type=int, default=75)
    options = parser.parse_args()
    recorded = list(frames_of(options.corpora / "grid-s1", options.frames))
    kinds = {
        "360x288": recorded,
        "1280x720, noise 0.7": enlarged(recorded, 0.7),
        "1280x720, noise 2": enlarged(recorded, 2),
    }
    chosen = dict(video._ENCODER)
    for kind, frames in kinds.items():
        for name, changes in SETTINGS.items():
            video._ENCODER.clear()
            video._ENCODER.update(chosen | changes)
            print(json.dumps({"frames": kind, "settings": name, **figures(frames)}), flush=True)


def frames_of(grid: Path, count: int) -> Iterator[Picture]:
    """Yield the first frames of the clips of ``val``."""
    for name in (grid / "val.txt").read_text().split():
        with open_video(grid / "clips" / f"{name}.mkv") as clip:
            for frame in clip.frames:
                yield frame.image
                count -= 1
                if not count:
                    return


def enlarged(frames: list[Picture], deviation: float) -> list[Picture]:
    """Return the upper part of frames as 1280 × 720 px, with noise that repeats every eight frames."""
    draw = np.random.default_rng(0)
    noise = [draw.normal(0, deviation, (720, 1280, 3)) for _ in range(8)]
    large = (cv2.resize(frame[:202], (1280, 720), interpolation=cv2.INTER_CUBIC) for frame in frames)
    return [np.clip(np.rint(one + noise[n % 8]), 0, 255).astype(np.uint8) for n, one in enumerate(large)]


def figures(frames: list[Picture]) -> dict[str, Any]:
    """Return time, size and likeness of a video of the frames."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mp4"
        sound = Audio(np.zeros(len(frames) * 640, np.float32), 16_000)
        start_s = time.process_time()
        video.write_mp4(path, frames, fps=25, audio=sound)
        cpu_s = time.process_time() - start_s
        size = path.stat().st_size
        with av.open(str(path)) as container:
            shown = np.array([luma(frame) for frame in container.decode(video=0)])[WARM_UP:]
    given = np.array([luma(av.VideoFrame.from_ndarray(frame)) for frame in frames[WARM_UP:]])
    mean = given.mean(axis=0, dtype=np.float32)
    detail = cv2.blur(mean * mean, (9, 9)) - cv2.blur(mean, (9, 9)) ** 2
    flat = detail < np.percentile(detail, 40)
    psnr = [decibel(*pair) for pair in zip(shown, given, strict=True)]
    return {
        "cpu_ms": round(cpu_s / len(frames) * 1e3, 2),
        "kB": round(size / len(frames) / 1e3, 2),
        "psnr": round(float(np.mean(psnr)), 2),
        "least": round(min(psnr), 2),
        "flat": round(decibel(shown[:, flat], given[:, flat]), 2),
        "flicker": round(flicker(shown) / flicker(given), 2),
        "gradient": round(gradient(shown) / gradient(given), 2),
    }


def luma(frame: av.VideoFrame) -> Picture:
    """Return the luma of a frame [shape=(H, W)], converted as ``write_mp4`` does."""
    converted: Picture = frame.reformat(format="yuv420p", dst_colorspace="itu601").to_ndarray()[: frame.height]
    return converted


def decibel(shown: Picture, given: Picture) -> float:
    """Return the peak signal-to-noise ratio."""
    return float(10 * np.log10(255**2 / np.mean(np.square(shown.astype(np.float32) - given))))


def flicker(pictures: Picture) -> float:
    """Return the mean absolute second difference in time."""
    return float(np.abs(np.diff(pictures.astype(np.int16), 2, axis=0)).mean())


def gradient(pictures: Picture) -> float:
    """Return the mean square of differences between neighbours, of every eighth picture."""
    some = pictures[::8].astype(np.int32)
    return sum(float(np.square(np.diff(some, axis=axis)).mean()) for axis in (1, 2))


if __name__ == "__main__":
    main()
