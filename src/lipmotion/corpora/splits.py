"""The lists train.txt, val.txt and test.txt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lipmotion.corpora.source_recordings import RecordingFolder
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.files import read_text_file

SPLITS = ("train", "val", "test")
LISTS = tuple(f"{split}.txt" for split in SPLITS)
LARGEST_LIST = 1 << 24
"""Bytes of a list of names."""
MOST_MISSING = 20_000
"""Names without a recording that are reported one by one; more of them are the list of another folder."""


def assign_splits(found: RecordingFolder, directory: Path) -> RecordingFolder:
    """Return the recordings with the splits that the lists in ``directory`` give them.

    Without lists everything is ``train``. With a train.txt, recordings in no list become problems, for training on
    them was not asked for; so do names without a recording.
    Raises CorpusError: a name stands in two lists, or more than ``MOST_MISSING`` names have no recording.
    """
    split_of = _read_lists(directory)
    rest = None if (directory / "train.txt").is_file() else "train"
    known = {item.name for item in found.items} | found.problems.keys()
    problems = {
        name: f"listed in {split}.txt, but there is no such recording"
        for name, split in split_of.items()
        if name not in known
    }
    if len(problems) > MOST_MISSING:
        raise CorpusError(
            f"{directory}: its lists name {len(problems)} recordings that are not in it, at most {MOST_MISSING} may "
            "be missing; are they those of another folder?"
        )
    items = []
    for item in found.items:
        split = split_of.get(item.name, rest)
        if split is None:
            problems[item.name] = f"in none of the lists of {directory} ({', '.join(LISTS)}); add it to one"
        else:
            items.append(replace(item, split=split))
    return RecordingFolder(found.kind, tuple(items), found.problems | problems)


def _read_lists(directory: Path) -> dict[str, str]:
    split_of: dict[str, str] = {}
    for split in SPLITS:
        path = directory / f"{split}.txt"
        for name in read_names(path) if path.is_file() else ():
            if split_of.setdefault(name, split) != split:
                raise CorpusError(f"{name} is in {split_of[name]}.txt and in {split}.txt of {directory}; keep one")
    return split_of


def read_names(path: Path) -> list[str]:
    """Return the names of utterances that a text file lists, one a line.

    Raises CorpusError: no such file, or not UTF-8 text.
    """
    try:
        lines = read_text_file(path, "list", LARGEST_LIST).splitlines()
    except InputError as error:
        raise CorpusError(f"{error}; required: one name a line") from error
    return [line.strip().replace("/", "-") for line in lines if line.strip()]
