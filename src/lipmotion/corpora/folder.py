"""Finding the recordings in a folder: all readers by kind, and that of any folder of videos, or sounds with motion.

Labels lie beside both where there are any. A video with a table of Live Link Face beside it is not tracked: the table
is its motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lipmotion.corpora.source_recordings import (
    AUDIO_SUFFIXES,
    LISTS,
    VIDEO_SUFFIXES,
    MotionFile,
    RecordingFolder,
    SourceRecording,
    assign_splits,
    filter_videos,
    is_of_recorder,
)
from lipmotion.errors import CorpusError, InputError
from lipmotion.extensions import Registry
from lipmotion.formats.label_files import find_labels
from lipmotion.formats.tables import is_live_link_file
from lipmotion.storage.files import check_listable

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
    kinds = set()
    for path in list_files(directory):
        has_motion = _is_sound(path) and not is_of_recorder(path) and path.is_file() and find_motion_files(path)
        if has_motion or filter_videos([path]):
            by_name.setdefault("-".join(path.relative_to(directory).with_suffix("").parts), []).append(path)
            kinds.add(SOUNDS if has_motion else VIDEOS)
    lists = frozenset(directory / name for name in LISTS)

    def read_recording(name: str, path: Path) -> SourceRecording:
        labels = find_labels(path, ignored=lists)
        siblings = find_motion_files(path) if _is_sound(path) else find_captures(path)
        if len(siblings) > 1:
            files = ", ".join(map(str, siblings))
            raise InputError(f"{path}: {len(siblings)} motion files beside it: {files}; keep one")
        motion_file = MotionFile(siblings[0]) if siblings else None
        speaker = (*path.relative_to(directory).parts[:-1], "")[0]
        return SourceRecording(name, path, labels.words, speaker=speaker, phones=labels.phones, motion_file=motion_file)

    kind = BOTH if len(kinds) > 1 else next(iter(kinds), VIDEOS)
    return gather_recordings(kind, by_name, read_recording, directory)


def list_files(directory: Path) -> list[Path]:
    """Return what is in a folder and its sub-folders, sorted, without what is hidden."""
    paths = ((path, path.relative_to(directory).parts) for path in directory.rglob("*"))
    return sorted(path for path, parts in paths if not any(part.startswith(".") for part in parts))


def gather_recordings(
    kind: str,
    by_name: Mapping[str, list[Path]],
    read_recording: Callable[[str, Path], SourceRecording],
    directory: Path,
) -> RecordingFolder:
    """Return the recordings of the files with each name; where it has several, or cannot be read, it is a problem.

    read_recording : returns a recording of its name and its file, or raises InputError
    directory : where the lists of the splits may lie
    """
    recordings, problems = [], {}
    for name, paths in by_name.items():
        try:
            if len(paths) > 1:
                files = ", ".join(map(str, paths))
                raise InputError(f"{len(paths)} recordings share this name: {files}; rename all but one")
            recordings.append(read_recording(name, paths[0]))
        except InputError as error:
            problems[name] = str(error)
    recordings.sort(key=lambda recording: recording.name)
    return assign_splits(RecordingFolder(kind, tuple(recordings), problems), directory)


def find_motion_files(sound: Path) -> list[Path]:
    """Return the motion files with the name of a sound, beside it."""
    return [path for suffix in MOTION_SUFFIXES if (path := sound.with_suffix(suffix)).is_file()]


def find_captures(video: Path) -> list[Path]:
    """Return the tables of Live Link Face with the name of a video, beside it: its motion need not be tracked."""
    tables = (video.with_suffix(suffix) for suffix in CAPTURE_SUFFIXES)
    return [path for path in tables if path.is_file() and is_live_link_file(path)]


def _is_sound(path: Path) -> bool:
    return path.suffix.lower() in AUDIO_SUFFIXES


CorpusReader = Callable[[Path], RecordingFolder | None]
"""Returns the recordings in a folder; None where the folder is not of the reader's kind."""
READERS: Registry[CorpusReader] = Registry(
    "corpus reader",
    "lipmotion.corpus_readers",
    {
        "grid": "lipmotion.corpora.layouts:read_grid",
        "facegood": "lipmotion.corpora.captured_faces:read_facegood",
        "vocaset": "lipmotion.corpora.captured_faces:read_vocaset",
        "layouts": "lipmotion.corpora.layouts:read_layouts",
        "folder": "lipmotion.corpora.folder:read_folder",
    },
)


def discover(directory: Path) -> RecordingFolder:
    """Return the recordings in a folder, from the first reader that recognises its kind.

    GRID of one speaker, FACEGOOD, VOCASET, the table of known corpora (``layouts``), then what installed packages add
    in alphabetical order, then any folder of videos or sounds.

    Raises InputError: no such folder. Raises CorpusError: no recordings in it, or its lists contradict each other.
    """
    if directory.is_file():
        raise InputError(f"{directory}: is a file; give the folder of recordings that it is in")
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give a folder of recordings")
    check_listable(directory)
    readers = sorted(READERS.names, key=lambda name: name == "folder")  # the one that reads any folder is the last
    folder = next(filter(None, (READERS.load(name)(directory) for name in readers)))
    if not folder.recordings and not folder.problems:
        raise CorpusError(
            f"{directory}: no videos in it, and no sounds with motion beside them; required: files ending in one of "
            f"{' '.join(sorted(VIDEO_SUFFIXES))}, or a sound and a file of the same name in {' '.join(MOTION_SUFFIXES)}"
        )
    return folder
