"""Generated motion as a drawn face: videos with sound, videos that are transparent, pictures."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.delivery import Delivery, close_on_frame_grid, find_closed_times
from lipmotion.articulation.phone_targets import with_gestures
from lipmotion.errors import ExportError
from lipmotion.kernels.compiler import numba_works
from lipmotion.meshes.fitting.blendshape_motion import is_of_blendshapes, with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.pipeline.outputs.curve_sets import show_edited_curves, with_curves
from lipmotion.pipeline.outputs.deliver import deliver, hold_mouth_poses
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Generation, Motion, Prosody
from lipmotion_faces.base import TRANSPARENT, Staging

LOG = logging.getLogger("lipmotion")
OPAQUE_SUFFIX = ".mp4"
VIDEO_SUFFIXES = (OPAQUE_SUFFIX, ".webm", ".mov")  # videos with sound; all but the first can be transparent
SOUND_RATE_HZ = 48_000  # sampling rate of the sound track
DRAWN_HZ, FASTEST_HZ = 25.0, 240.0
"""Frame rate of videos of drawn faces, and the highest one: each picture is drawn, and no screen shows more."""


def deliver_to_face(
    generation: Generation,
    delivery: Delivery,
    fps: float,
    character: DrivenCharacter | None = None,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> Generation:
    """Return generated motion as a face shows it: with the channels that faces draw, and held poses at the frame rate.

    character : whose weights are shown, where the face is a character with blendshapes
    staging, prosody : as of ``show_edited_curves``, which all other edits of curves go through
    """
    shown = with_drawn_channels(deliver(generation, delivery))
    solved = character if character is not None and character.shapes is not None else None
    shown = show_edited_curves(shown, staging, prosody, mouth=solved is None)
    if shown.curve_edits and solved is not None:
        shown = with_curves(shown, solved)[0]
    if not (frames := delivery.hold_frames(fps)):
        return shown
    shown = shown.with_motion(with_gestures(shown.motion, shown.units))
    closed_s, shown = find_closed_times(shown), close_on_frame_grid(shown, fps)
    if solved is not None:
        shown = with_curves(shown, solved)[0]
    return hold_mouth_poses(shown.resampled(fps), frames, closed_s)


def with_drawn_channels(generation: Generation) -> Generation:
    """Return a generation with the channels that faces draw: those of a mouth, where it has blendshapes."""
    return generation.with_motion(with_mouth(generation.motion)) if is_of_blendshapes(generation.motion) else generation


class VideoOutput(Output):
    """``.mp4``, ``.webm``, ``.mov``: a face that speaks, with sound."""

    draws, has_sound = True, True

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return VIDEO_SUFFIXES

    def check(self) -> None:  # noqa: D102
        settings = self.settings
        fps = settings.outputs.fps
        if fps is not None and fps > FASTEST_HZ:
            required = f"required {FASTEST_HZ:g} or fewer in a video; the rate of motion files alone is --rate"
            raise ExportError(f"{self.path}: {fps:g} pictures a second, {required}")
        if settings.delivery.offset_ms and self.has_sound:
            raise ExportError(
                f"{self.path}: a video has its own sound, which begins with it; an offset is for files that are put "
                "beside a sound: write the video without it"
            )
        settings.face.check_video(self.path, settings)
        if settings.recording is None and not settings.sounded:
            raise ExportError(f"{self.path}: a video needs the recording: write(..., speech=FILE)")

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        face = self.settings.face
        face.check_drawable(self.path, performance.generation)
        return partial(face.write_video, self.path, performance)


class PicturesOutput(VideoOutput):
    """``NAME%05d.png``: the pictures of a video, numbered, without sound."""

    has_sound = False

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return ("%05d.png",)

    @classmethod
    def takes(cls, path: Path, settings: OutputSettings) -> bool:  # noqa: D102, ARG003
        return is_picture_sequence(path)


def load_track(performance: Performance) -> Audio:
    """Return the sound of videos. Raises InputError: the recording cannot be read."""
    return read_sound(performance.sound or performance.settings.recording)


def read_sound(recording: str | Path | Audio | None) -> Audio:
    """Return the sound of a recording as videos have it. Raises InputError: it cannot be read."""
    if isinstance(recording, Audio):
        return recording
    return read_audio(Path(str(recording)), SOUND_RATE_HZ, warn=False)


def is_picture_sequence(path: Path) -> bool:
    """Return whether a path stands for numbered pictures: ``frame%05d.png``."""
    return path.suffix.lower() == ".png" and re.search(r"%0?\d?d", path.name) is not None


def check_background(path: Path, staging: Staging) -> None:
    """Raise ExportError if a face is to be transparent in a file that cannot be."""
    if staging.background == TRANSPARENT and path.suffix.lower() == OPAQUE_SUFFIX:
        others = "write .webm, .mov or %05d.png, or give a colour"
        raise ExportError(f"{path}: {OPAQUE_SUFFIX} cannot be transparent; {others}")


def check_drawable(path: Path, motion: Motion) -> None:
    """Raise ExportError if motion has no channel from which a face can be drawn."""
    if "opening" not in motion.names and not is_of_blendshapes(motion):
        missing = "no channel 'opening' to draw a face from, nor the blendshape 'jawOpen'"
        raise ExportError(f"{path}: the motion has {missing}; write motion files")


def report_cost(path: Path, pictures: Iterable[NDArray[np.uint8]], count: int) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures; once the first one is drawn by Python alone, say how long all ``count`` of them will take."""
    start_s = time.monotonic()
    for number, picture in enumerate(pictures):
        if not number and not numba_works():
            about = f"without numba its {count} pictures take about {(time.monotonic() - start_s) * count / 60:.1f} min"
            LOG.warning("%s: %s; pip install numba, or choose a simpler face or a smaller --size", path, about)
        yield picture


def count_pictures(generation: Generation, fps: float) -> int:
    """Return the number of pictures of a motion."""
    return int(generation.motion.time_s[-1] * fps + 1e-9) + 1


def write_frames(path: Path, frames: Iterable[NDArray[np.uint8]], fps: float, sound: Audio) -> None:
    """Write pictures with their sound in the format of the suffix. Raises ExportError: the file cannot be written."""
    from lipmotion_faces.video.mp4 import write_mp4, write_pictures, write_with_alpha

    if is_picture_sequence(path):
        write_pictures(path, frames)
    elif path.suffix.lower() == OPAQUE_SUFFIX:
        write_mp4(path, frames, fps=fps, audio=sound)
    else:
        write_with_alpha(path, frames, fps=fps, audio=sound)
