"""Generated motion as a drawn face: videos with sound, videos that are transparent, pictures."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import numpy as np

from lipmotion.errors import ExportError, InputError
from lipmotion.faces.base import SMALLEST, TRANSPARENT, DrawsPlanes, Face, Staging
from lipmotion.faces.filmed.face import FilmedFace
from lipmotion.faces.registry import staged_face
from lipmotion.kernels.choice import numba_works
from lipmotion.pipeline.film.video import RENDERING
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.features.prosody import prosody_of
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from lipmotion.speech.sound.decimation import decimated
from lipmotion.types import Audio, Channel, Generation, Monitor, Motion, Prosody, Timeline
from lipmotion.types.progress import with_reports

OPAQUE_SUFFIX = ".mp4"
VIDEO_SUFFIXES = (OPAQUE_SUFFIX, ".webm", ".mov")
"""Videos with sound; all but the first can be transparent."""


def shows_face(path: Path) -> bool:
    """Return whether a path is that of a drawn face: a video, or pictures such as ``frame%05d.png``."""
    return path.suffix.lower() in VIDEO_SUFFIXES or is_picture_sequence(path)


def is_picture_sequence(path: Path) -> bool:
    """Return whether a path stands for numbered pictures: ``frame%05d.png``."""
    return path.suffix.lower() == ".png" and re.search(r"%0?\d?d", path.name) is not None


def check_background(path: Path, staging: Staging) -> None:
    """Raise ExportError if a face is to be transparent in a file that cannot be."""
    if staging.background == TRANSPARENT and path.suffix.lower() == OPAQUE_SUFFIX:
        raise ExportError(
            f"{path}: {OPAQUE_SUFFIX} cannot be transparent; write .webm, .mov or %05d.png, or give a colour"
        )


def check_staging(face: Face | FilmedFace, staging: Staging) -> None:
    """Raise InputError if a face cannot be staged so."""
    if not isinstance(face, FilmedFace):
        staged_face(face, staging)
    elif staging != Staging():
        raise InputError("size, colour of the background and what moves are of drawn faces; leave them out")


def write_drawn_face(
    path: Path,
    generation: Generation,
    sound: Audio,
    fps: float,
    face: Face,
    staging: Staging,
    monitor: Monitor,
    prosody: Prosody | None = None,
) -> None:
    """Write generated motion as a drawn face, in the format of the suffix; brows and head move with the sound.

    prosody : loudness and pitch in the time of the motion; None: those of the sound, which begins with the motion
    monitor : receives reports of the progress
    Raises ExportError: the file cannot be written.  Raises InputError: no such face, or it cannot be staged so.
    """
    from lipmotion.export.transparent import write_pictures, write_with_alpha
    from lipmotion.export.video import write_mp4

    staged, drawn = staged_face(face, staging, prosody or prosody_heard(sound)), None
    if path.suffix.lower() == OPAQUE_SUFFIX and isinstance(staged, DrawsPlanes):
        drawn = staged.render_planes(generation.motion, generation.units, fps=fps)
    if drawn is None:
        drawn = staged.render(generation.motion, generation.units, fps=fps)
    frames = with_reports(drawn, int(generation.motion.time_s[-1] * fps + 1e-9) + 1, RENDERING, monitor)
    if is_picture_sequence(path):
        write_pictures(path, frames)
    elif path.suffix.lower() == OPAQUE_SUFFIX:
        write_mp4(path, frames, fps=fps, audio=sound)
    else:
        write_with_alpha(path, frames, fps=fps, audio=sound)


def load_drawing(face: Face) -> None:
    """Load what draws a face for videos (compiled kernels), so that drawing it begins sooner."""
    if isinstance(face, DrawsPlanes) and numba_works():
        closed = Motion(np.zeros((1, 1)), 1.0, (Channel("opening"),))
        smallest = staged_face(face, Staging(size=SMALLEST))
        if isinstance(smallest, DrawsPlanes) and (frames := smallest.render_planes(closed, Timeline(()))) is not None:
            list(frames)


def prosody_heard(speech: str | Path | Audio) -> Prosody:
    """Return loudness and pitch of a recording or a sound, for movements of brows and head.

    A sound that is shorter than one frame of speech is followed by silence.

    Raises InputError: the recording cannot be read.
    """
    sound = speech if isinstance(speech, Audio) else read_audio(Path(speech), SPEECH_RATE_HZ, warn=False)
    ratio = Fraction(SPEECH_RATE_HZ, int(sound.rate_hz))
    samples = sound.samples.astype(np.float32)
    if ratio.numerator == 1:
        samples = decimated(samples, ratio.denominator)
    else:
        from scipy.signal import resample_poly

        samples = resample_poly(samples, ratio.numerator, ratio.denominator).astype(np.float32)
    missing = max(WINDOW - len(samples), 0)
    return prosody_of(Audio(np.pad(samples, (0, missing)), SPEECH_RATE_HZ))
