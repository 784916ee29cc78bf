"""The real video of a line: its recording, where that is a video, or a video of the same name beside its sound."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.source_recordings import VIDEO_SUFFIXES
from lipmotion.export.video import write_mp4
from lipmotion.pipeline.outputs.drawn_video import read_sound
from lipmotion.storage.media import has_video, open_media, video_streams
from lipmotion.vision.footage import untracked_frames

PLAYED = {
    ".mp4": ("video/mp4", ("h264", "av1", "dav1d")),
    ".m4v": ("video/mp4", ("h264", "av1", "dav1d")),
    ".webm": ("video/webm", ("vp8", "vp9", "av1", "dav1d")),
}
"""What browsers play as it is: the kind of a file by its suffix, and the codecs in it."""
MP4 = "video/mp4"


def video_of(recording: Path) -> Path | None:
    """Return the path of the real video of a recording; None: there is none.

    recording : a sound or a video
    """
    if recording.suffix.lower() in VIDEO_SUFFIXES:
        return recording if has_video(recording) else None
    beside = (recording.with_suffix(suffix) for suffix in sorted(VIDEO_SUFFIXES))
    return next((path for path in beside if path.is_file() and has_video(path)), None)


def played_as(path: Path) -> str | None:
    """Return the media type of a video that browsers play as it is; None: they do not, and it is written anew."""
    kind, codecs = PLAYED.get(path.suffix.lower(), ("", ()))
    if not kind:
        return None
    with open_media(path) as container:
        return kind if video_streams(container)[0].codec_context.name.removeprefix("lib") in codecs else None


def write_playable(video: Path, sound: Path, path: Path) -> None:
    """Write a video as browsers play it, with the sound of a line. Raises InputError: it cannot be read.

    Raises ExportError: it cannot be written.
    """
    frames, rate_hz = untracked_frames(video)
    even = (frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2] for frame in frames)
    write_mp4(path, even, fps=rate_hz, audio=read_sound(sound))
