"""What every kind of recording comes down to."""

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
    """Motion in a file of its own.

    file     : what ``animate`` writes (.csv .json .npz), or a bare array of numbers (.npy)
    rate_hz  : frames per second of a bare array, which does not say; None: the file says
    channels : those of a bare array; empty: the file says
    """

    file: Path
    rate_hz: float | None = None
    channels: tuple[Channel, ...] = ()


@dataclass(frozen=True)
class SourceRecording:
    """One sentence, heard and seen.

    name    : unique in its folder, usable as a folder's name
    file    : the video, or the sound that belongs to the curves
    words   : the transcript, or None where it is not known
    split   : ``train``, ``val`` or ``test``
    rights  : licence and attribution, where known
    speaker : who speaks, empty where it is not known
    phones  : labelled phones in time, or None
    curves  : the motion, or None: ``file`` shows the face that is to be tracked
    """

    name: str
    file: Path
    words: tuple[str, ...] | None
    split: str = "train"
    rights: dict[str, str] = field(default_factory=dict)
    speaker: str = ""
    phones: Timeline[Unit] | None = None
    curves: MotionFile | None = None


@dataclass(frozen=True)
class RecordingFolder:
    """All that was found in a folder.

    kind     : the reader that fitted, in words
    items    : the recordings, sorted by name
    problems : what cannot be used, name to reason
    """

    kind: str
    items: tuple[SourceRecording, ...]
    problems: dict[str, str] = field(default_factory=dict)


def video_files(paths: Iterable[Path]) -> list[Path]:
    """Return the visible files with a video's suffix, sorted."""
    return sorted(path for path in paths if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file())
