"""Which kind of recordings a folder holds."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.base import VIDEO_SUFFIXES, Recordings
from lipmotion.corpora.folder import read_folder
from lipmotion.corpora.grid import read_grid
from lipmotion.errors import CorpusError, InputError


def discover(directory: Path) -> Recordings:
    """Return what a folder holds, read by the first reader that fits: GRID, then a plain folder of videos.

    Raises InputError: no such folder. Raises CorpusError: no videos in it, or its lists contradict each other.
    """
    if directory.is_file():
        raise InputError(f"{directory}: is a file; give the folder of videos that it is in")
    if not directory.is_dir():
        raise InputError(f"{directory}: no such folder; give a folder of videos")
    found = read_grid(directory) or read_folder(directory)
    if not found.items and not found.problems:
        suffixes = " ".join(sorted(VIDEO_SUFFIXES))
        raise CorpusError(f"{directory}: no videos in it; required: files ending in one of {suffixes}")
    return found
