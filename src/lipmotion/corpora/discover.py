"""Finding the recordings in a folder, with the reader of its kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lipmotion.corpora.folder import MOTION_SUFFIXES
from lipmotion.corpora.source_recordings import VIDEO_SUFFIXES, RecordingFolder
from lipmotion.errors import CorpusError, InputError
from lipmotion.extensions import Registry
from lipmotion.storage.files import check_listable

CorpusReader = Callable[[Path], RecordingFolder | None]
"""Returns the recordings in a folder; None where the folder is not of the reader's kind."""
READERS: Registry[CorpusReader] = Registry(
    "corpus reader",
    "lipmotion.corpus_readers",
    {
        "grid": "lipmotion.corpora.layouts:read_grid",
        "facegood": "lipmotion.corpora.facegood:read_facegood",
        "vocaset": "lipmotion.corpora.vocaset:read_vocaset",
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
    found = next(filter(None, (READERS.load(name)(directory) for name in readers)))
    if not found.recordings and not found.problems:
        raise CorpusError(
            f"{directory}: no videos in it, and no sounds with motion beside them; required: files ending in one of "
            f"{' '.join(sorted(VIDEO_SUFFIXES))}, or a sound and a file of the same name in {' '.join(MOTION_SUFFIXES)}"
        )
    return found
