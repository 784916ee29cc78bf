"""Reader of folders with videos, or with sounds and motion files; labels beside both where there are any.

A video with a table of Live Link Face beside it is not tracked: the table is its motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lipmotion.corpora.separate_sounds import is_of_recorder
from lipmotion.corpora.source_recordings import (
    AUDIO_SUFFIXES,
    MotionFile,
    RecordingFolder,
    SourceRecording,
    filter_videos,
)
from lipmotion.corpora.splits import LISTS, assign_splits
from lipmotion.errors import InputError
from lipmotion.formats.label_files import RecordingLabels, find_labels
from lipmotion.formats.tables import is_live_link_file

VIDEOS, SOUNDS, BOTH = "folder of videos", "folder of sounds with motion", "folder of videos, and of sounds with motion"
VIDEO_KINDS = (VIDEOS, BOTH)
"""Kinds of folders whose videos may be longer than a sentence."""
MOTION_SUFFIXES = (".csv", ".json", ".npz", ".livelink.csv", ".c3d", ".fap")
"""Motion files that ``read_motion`` reads, and that may lie beside a sound."""
CAPTURE_SUFFIXES = (".csv", ".livelink.csv")
"""Tables of Live Link Face, which may also lie beside the video that the app records with them."""


def read_folder(directory: Path) -> RecordingFolder:
    """Return the recordings in a folder and its sub-folders: videos, and sounds with a motion file of the same name.

    Transcripts and labels have the name of the recording: ``take1.txt``, ``take1.TextGrid``, ``take1.lab``. Recordings
    in a sub-folder ``anna`` have the speaker ``anna``, and names as ``anna-take1``.
    """
    by_name: dict[str, list[Path]] = {}
    for path in list_files(directory):
        if _has_motion(path) or filter_videos([path]):
            name = "-".join(path.relative_to(directory).with_suffix("").parts)
            by_name.setdefault(name, []).append(path)
    lists = frozenset(directory / name for name in LISTS)
    return gather_recordings(
        _kind(by_name), by_name, lambda name, path: _recording(name, path, directory, lists), directory
    )


def list_files(directory: Path) -> list[Path]:
    """Return what is in a folder and its sub-folders, sorted, without what is hidden."""
    paths = ((path, path.relative_to(directory).parts) for path in directory.rglob("*"))
    return sorted(path for path, parts in paths if not any(part.startswith(".") for part in parts))


def gather_recordings(
    kind: str,
    by_name: Mapping[str, list[Path]],
    recording_of: Callable[[str, Path], SourceRecording],
    directory: Path,
) -> RecordingFolder:
    """Return the recordings of the files with each name; where it has several, or cannot be read, it is a problem.

    recording_of : returns a recording of its name and its file, or raises InputError
    directory    : where the lists of the splits may lie
    """
    recordings, problems = [], {}
    for name, paths in by_name.items():
        try:
            recordings.append(recording_of(name, _only(paths)))
        except InputError as error:
            problems[name] = str(error)
    recordings.sort(key=lambda recording: recording.name)
    return assign_splits(RecordingFolder(kind, tuple(recordings), problems), directory)


def _recording(name: str, path: Path, directory: Path, lists: frozenset[Path]) -> SourceRecording:
    labels: RecordingLabels = find_labels(path, ignored=lists)
    beside = find_motion_files(path) if _is_sound(path) else find_captures(path)
    if len(beside) > 1:
        raise InputError(f"{path}: {len(beside)} motion files beside it: {', '.join(map(str, beside))}; keep one")
    motion_file = MotionFile(beside[0]) if beside else None
    folders = path.relative_to(directory).parts[:-1]
    speaker = folders[0] if folders else ""
    return SourceRecording(name, path, labels.words, speaker=speaker, phones=labels.phones, motion_file=motion_file)


def find_motion_files(sound: Path) -> list[Path]:
    """Return the motion files with the name of a sound, beside it."""
    return [path for suffix in MOTION_SUFFIXES if (path := sound.with_suffix(suffix)).is_file()]


def find_captures(video: Path) -> list[Path]:
    """Return the tables of Live Link Face with the name of a video, beside it: its motion need not be tracked."""
    tables = (video.with_suffix(suffix) for suffix in CAPTURE_SUFFIXES)
    return [path for path in tables if path.is_file() and is_live_link_file(path)]


def _is_sound(path: Path) -> bool:
    return path.suffix.lower() in AUDIO_SUFFIXES


def _has_motion(path: Path) -> bool:
    return _is_sound(path) and not is_of_recorder(path) and path.is_file() and bool(find_motion_files(path))


def _only(paths: list[Path]) -> Path:
    """Return the only path. Raises InputError: there are several."""
    if len(paths) > 1:
        raise InputError(f"{len(paths)} recordings share this name: {', '.join(map(str, paths))}; rename all but one")
    return paths[0]


def _kind(by_name: dict[str, list[Path]]) -> str:
    """Return the kind of folder, in words."""
    sounds = {_is_sound(path) for paths in by_name.values() for path in paths}
    if len(sounds) > 1:
        return BOTH
    return SOUNDS if True in sounds else VIDEOS
