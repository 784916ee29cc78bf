"""What every kind of recording comes down to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

VIDEO_SUFFIXES = frozenset(
    f".{name}" for name in "3gp avi flv m2ts m4v mkv mov mp4 mpeg mpg mts mxf ogv ts vob webm wmv".split()
)


@dataclass(frozen=True)
class Recording:
    """One sentence on video.

    name   : unique in its folder, usable as a folder's name
    video  : the file
    words  : the transcript, or None where it is not known
    split  : ``train``, ``val`` or ``test``
    rights : licence and attribution, where known
    """

    name: str
    video: Path
    words: tuple[str, ...] | None
    split: str = "train"
    rights: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recordings:
    """All that was found in a folder.

    kind     : the reader that fitted, in words
    items    : the recordings, sorted by name
    problems : what cannot be used, name to reason
    """

    kind: str
    items: tuple[Recording, ...]
    problems: dict[str, str] = field(default_factory=dict)


def videos(paths: Iterable[Path]) -> list[Path]:
    """Return the visible files with a video's suffix, sorted."""
    return sorted(path for path in paths if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file())
