"""Which kind of recordings a folder holds."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.facegood import read_facegood
from lipmotion.corpora.folder import MOTION_SUFFIXES, read_folder
from lipmotion.corpora.grid import read_grid
from lipmotion.corpora.source_recordings import VIDEO_SUFFIXES, RecordingFolder
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.files import check_listable


def discover(directory: Path) -> RecordingFolder:
    """Return what a folder holds, read by the first reader that fits: GRID, FACEGOOD, then any other folder.

    Raises InputError: no such folder. Raises CorpusError: no recordings in it, or its lists contradict each other.
    """
    if directory.is_file():
        raise InputError(f"{directory}: is a file; give the folder of recordings that it is in")
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give a folder of recordings")
    check_listable(directory)
    found = read_grid(directory) or read_facegood(directory) or read_folder(directory)
    if not found.items and not found.problems:
        raise CorpusError(
            f"{directory}: no videos in it, and no sounds with motion beside them; required: files ending in one of "
            f"{' '.join(sorted(VIDEO_SUFFIXES))}, or a sound and a file of the same name in {' '.join(MOTION_SUFFIXES)}"
        )
    return found
