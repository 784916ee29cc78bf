"""Footage of the drawn person: videos, and what a tracker that makes no errors would say of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.types import Audio, Channel, Motion, Track
from lipmotion_faces.film import background, build
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.track import Footage
from lipmotion_faces.video.mp4 import write_mp4
from testing.toy import ToySentence, toy_motion, toy_sentences
from testing.toy_face import FRAME_HEIGHT, FRAME_WIDTH, SHAPE, toy_chin_px, toy_frames, toy_places

EYES_PX = 90.0


@dataclass(frozen=True, eq=False)
class ToyVideo:
    """A video of the drawn person, and its motion."""

    path: Path
    motion: Motion


def write_video(path: Path, sentence: ToySentence, rate_hz: float = 25.0, *, silent: bool = False) -> ToyVideo:
    motion = toy_motion(sentence.units, rate_hz)
    frames = toy_frames(motion, toy_places(len(motion.values), rate_hz))
    sound = sentence.audio
    write_mp4(path, frames, fps=rate_hz, audio=Audio(sound.samples * (not silent), sound.rate_hz))
    return ToyVideo(path, motion)


def write_videos(folder: Path, count: int) -> dict[Path, ToyVideo]:
    """Make a folder of the first toy sentences as videos; return them by their paths."""
    folder.mkdir()
    found = [write_video(folder / f"{sentence.name}.mp4", sentence) for sentence in toy_sentences(count)]
    return {video.path.resolve(): video for video in found}


def footage_of(video: ToyVideo, span: VideoSpan = WHOLE, seen: np.ndarray | None = None) -> Footage:
    """Return the footage that a tracker without errors finds."""
    rate_hz, lips = video.motion.rate_hz, video.motion
    first, last = round(span.start_s * rate_hz), min(len(lips.values), round(min(span.end_s, 1e6) * rate_hz))
    count = last - first
    half = SHAPE.half_width_px / 1.15 / EYES_PX
    chin = -toy_chin_px(lips)[first:last] / EYES_PX
    more = np.column_stack([np.full(count, -half), np.full(count, half), chin, np.arange(count) % 7])
    channels = (*lips.channels, *map(Channel, ("x_150", "x_379", "y_152", "z_152")))
    motion = Motion(np.column_stack([lips.values[first:last], more]), rate_hz, channels)
    return Footage(
        video.path,
        span,
        Track(motion, np.ones(count, bool) if seen is None else seen[first:last]),
        toy_places(len(lips.values), rate_hz)[first:last],
        np.arange(count) / rate_hz,
        (),
        (FRAME_HEIGHT, FRAME_WIDTH),
        rate_hz,
    )


def install(
    monkeypatch: pytest.MonkeyPatch,
    videos: Mapping[Path, ToyVideo],
    seen: Mapping[Path, np.ndarray],
    least_s: float = build.MIN_FOOTAGE_S,
) -> None:
    """Let the tracker know these videos, and so many seconds be enough for a face."""

    def track_footage(path: Path, span: VideoSpan = WHOLE) -> Footage:
        if path.resolve() in seen and not len(seen[path.resolve()]):
            raise InputError(f"{path}: no face in 60 of 60 frames")
        return footage_of(videos[path.resolve()], span, seen.get(path.resolve()))

    monkeypatch.setattr(build, "MIN_FOOTAGE_S", least_s)
    for module in (build, background):
        monkeypatch.setattr(module, "track_footage", track_footage)
    monkeypatch.setattr(background, "register_maps", lambda footage: footage.face_to_image)  # needs OpenCV
