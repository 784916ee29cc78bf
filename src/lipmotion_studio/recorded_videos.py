"""The real video of a recording: its recording, where that is a video, or a video of the same name beside its sound."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.source_recordings import VIDEO_SUFFIXES
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from lipmotion.storage.media import has_video, open_media, video_streams
from lipmotion_faces.outputs.drawn_video import read_sound
from lipmotion_faces.tracking.footage import read_video_frames
from lipmotion_faces.video.mp4 import write_mp4

PLAYED = {
    ".mp4": ("video/mp4", ("h264", "av1", "dav1d")),
    ".m4v": ("video/mp4", ("h264", "av1", "dav1d")),
    ".webm": ("video/webm", ("vp8", "vp9", "av1", "dav1d")),
}
"""What browsers play as it is: the kind of a file by its suffix, and the codecs in it."""
MP4 = "video/mp4"
IN_STEP_S = 0.005
"""Sound and pictures that begin further apart do not begin together."""
LOUDNESS_HZ = 100
"""Rate of the loudness by which two sounds are compared: encoders move samples a little, which it hardly shows."""


def find_real_video(recording: Path) -> Path | None:
    """Return the path of the real video of a recording, a sound or a video; None: there is none."""
    if recording.suffix.lower() in VIDEO_SUFFIXES:
        return recording if has_video(recording) else None
    siblings = (recording.with_suffix(suffix) for suffix in sorted(VIDEO_SUFFIXES))
    return next((path for path in siblings if path.is_file() and has_video(path)), None)


def media_type(path: Path) -> str | None:
    """Return the media type of a video that browsers play as it is; None: they do not, and it is written anew."""
    kind, codecs = PLAYED.get(path.suffix.lower(), ("", ()))
    if not kind:
        return None
    with open_media(path) as container:
        is_known = video_streams(container)[0].codec_context.name.removeprefix("lib") in codecs
        return kind if is_known and (container.start_time or 0) < IN_STEP_S * 1e6 else None


def sound_begins_s(video: Path, sound: Path) -> float:
    """Return when in a real video the sound of its recording begins, in seconds from the beginning of the video.

    sound : the recording: the video itself, of which the readers have silence before a sound that begins later than
            the pictures; or another file, which begins with the video or, as programs that extract sound leave that
            silence out, with the sound in it: where it is more like the sound of the video
    Raises InputError: one of both cannot be read.
    """
    late_s = 0.0
    if sound != video:
        with open_media(video) as container:
            for stream in list(container.streams.audio)[:1]:
                start_s = float((stream.start_time or 0) * stream.time_base)
                late_s = max(start_s - (container.start_time or 0) / 1e6, 0.0)
    if late_s < IN_STEP_S:
        return 0.0
    whole, other = map(_loudness, (video, sound))
    return late_s if _correlate(whole[round(late_s * LOUDNESS_HZ) :], other) > _correlate(whole, other) else 0.0


def _loudness(path: Path) -> NDArray[np.float64]:
    samples, each = np.abs(read_audio(path, warn=False).samples), SPEECH_RATE_HZ // LOUDNESS_HZ
    return np.sqrt(samples[: len(samples) // each * each].reshape(-1, each).mean(axis=1, dtype=float))


def _correlate(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the correlation of two courses that begin together, over what both have."""
    count = min(len(one), len(other))
    one, other = one[:count] - one[:count].mean(), other[:count] - other[:count].mean()
    return float(one @ other) / max(float(np.sqrt((one @ one) * (other @ other))), 1e-12)


def write_playable(video: Path, sound: Path, path: Path) -> None:
    """Write a video as browsers play it, with a recording's sound. Raises InputError, ExportError."""
    frames, rate_hz = read_video_frames(video)
    even = (frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2] for frame in frames)
    write_mp4(path, even, fps=rate_hz, audio=read_sound(sound))
