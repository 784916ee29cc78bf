"""The lists train.txt, val.txt and test.txt, which assign recordings to splits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lipmotion.corpora.source_recordings import RecordingFolder
from lipmotion.errors import CorpusError, InputError
from lipmotion.storage.files import read_text_file

SPLITS = ("train", "val", "test")
LISTS = tuple(f"{split}.txt" for split in SPLITS)
LARGEST_LIST_BYTES = 1 << 24
"""Most bytes of a list of names."""
MAX_MISSING_NAMES = 20_000
"""Names without a recording that are reported one by one; more of them mean a list of another folder."""


def assign_splits(folder: RecordingFolder, directory: Path) -> RecordingFolder:
    """Return the recordings with the splits of the lists in ``directory``.

    Without lists all stay what their layout says, ``train`` as a rule. With a train.txt, recordings that are in no
    list become problems, because they are not meant for training; so do names without a recording.
    A list may name files (``take08.mkv``), or have remarks after a name: where no recording has that name, they are
    left out.
    Raises CorpusError: a name is in two lists, or more than ``MAX_MISSING_NAMES`` names have no recording.
    """
    known = {recording.name for recording in folder.recordings} | folder.problems.keys()
    split_of: dict[str, str] = {}
    for split in SPLITS:
        path = directory / f"{split}.txt"
        for listed in read_names(path) if path.is_file() else ():
            shorter = (listed.rpartition(".")[0], listed.split()[0])  # without a suffix, or the remarks of LRS2's lists
            name = listed if listed in known else next((each for each in shorter if each in known), listed)
            if split_of.setdefault(name, split) != split:
                raise CorpusError(f"{name} is in {split_of[name]}.txt and in {split}.txt of {directory}; keep one")
    has_list = (directory / "train.txt").is_file()
    problems = {
        name: f"listed in {split}.txt, but there is no such recording"
        for name, split in split_of.items()
        if name not in known
    }
    if len(problems) > MAX_MISSING_NAMES:
        raise CorpusError(
            f"{directory}: its lists name {len(problems)} recordings that are not in it, at most {MAX_MISSING_NAMES} "
            "may be missing; are they those of another folder?"
        )
    recordings = []
    for recording in folder.recordings:
        assigned = split_of.get(recording.name, None if has_list else recording.split)
        if assigned is None:
            problems[recording.name] = f"in none of the lists of {directory} ({', '.join(LISTS)}); add it to one"
        else:
            recordings.append(replace(recording, split=assigned))
    return RecordingFolder(folder.kind, tuple(recordings), folder.problems | problems)


def read_names(path: Path) -> list[str]:
    """Return the names of utterances that a text file lists, one a line.

    Raises CorpusError: no such file, or not UTF-8 text.
    """
    try:
        lines = read_text_file(path, "list", LARGEST_LIST_BYTES).splitlines()
    except InputError as error:
        raise CorpusError(f"{error}; required: one name a line") from error
    return [line.strip().replace("/", "-") for line in lines if line.strip()]
