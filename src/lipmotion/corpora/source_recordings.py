"""Source recordings: what every reader of a folder returns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from lipmotion.types import Channel, Timeline, Unit

VIDEO_SUFFIXES = frozenset(
    f".{name}" for name in "3gp avi flv m2ts m4v mkv mov mp4 mpeg mpg mts mxf ogv ts vob webm wmv".split()
)


AUDIO_SUFFIXES = frozenset(f".{name}" for name in "aac aif aiff flac m4a mp3 oga ogg opus wav wma".split())


@dataclass(frozen=True)
class MotionFile:
    """A file with the motion that goes with a sound.

    file     : as ``animate`` writes it (.csv .json .npz), a bare array of numbers (.npy), or the first mesh (.ply)
    rate_hz  : frame rate of a bare array, or of meshes; None: the file states it
    channels : of a bare array; empty: the file states them
    """

    file: Path
    rate_hz: float | None = None
    channels: tuple[Channel, ...] = ()


@dataclass(frozen=True)
class SourceRecording:
    """One recorded sentence: sound with motion, or video.

    name        : unique in its folder, usable as a folder's name
    file        : the video, or the sound that goes with the motion file
    words       : the transcript, or None where it is not known
    split       : ``train``, ``val`` or ``test``
    rights      : licence and attribution, where known
    speaker     : name of the speaker, empty where it is not known
    phones      : labelled phones in time, or None
    motion_file : the motion; None: the face in ``file`` is to be tracked
    start_s     : where in the file the sentence begins, s
    end_s       : where it ends; None: the file is this one sentence
    recorder    : its sound as a recorder of its own made it, not in step; None: the sound of ``file`` is used
    offset_s    : by how much the sound that is used is late, where that is given
    """

    name: str
    file: Path
    words: tuple[str, ...] | None
    split: str = "train"
    rights: dict[str, str] = field(default_factory=dict)
    speaker: str = ""
    phones: Timeline[Unit] | None = None
    motion_file: MotionFile | None = None
    start_s: float = 0.0
    end_s: float | None = None
    recorder: Path | None = None
    offset_s: float | None = None


@dataclass(frozen=True)
class RecordingFolder:
    """The recordings in a folder.

    kind       : the kind of folder, in words
    recordings : those that can be used, sorted by name
    problems   : those that cannot be used, name to reason
    """

    kind: str
    recordings: tuple[SourceRecording, ...]
    problems: dict[str, str] = field(default_factory=dict)


def filter_videos(paths: Iterable[Path]) -> list[Path]:
    """Return the files with the suffix of a video, sorted."""
    return sorted(path for path in paths if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file())
