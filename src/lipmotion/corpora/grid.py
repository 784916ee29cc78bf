"""The GRID corpus: clips, word times, and sentences spelled out by their file names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from lipmotion.corpora.source_recordings import RecordingFolder, SourceRecording, video_files
from lipmotion.corpora.splits import assign_splits
from lipmotion.errors import InputError, shortened

KIND = "GRID corpus"
RIGHTS = {
    "licence": "CC BY 4.0",
    "attribution": "GRID corpus (Cooke, Barker, Cunningham, Shao 2006), CC BY 4.0",
}

SILENCES = frozenset({"sil", "sp"})
"""Labels of a word-time file that are not words."""
WORD = re.compile(r"[^\W\d_]+(?:['-][^\W\d_]+)*")
LARGEST_ALIGNMENT_BYTES = 1 << 16
"""Most bytes of a word-time file; GRID's have a hundred."""

COMMANDS = {"b": "bin", "l": "lay", "p": "place", "s": "set"}
COLOURS = {"b": "blue", "g": "green", "r": "red", "w": "white"}
PREPOSITIONS = {"a": "at", "b": "by", "i": "in", "w": "with"}
DIGITS = dict(zip("z123456789", "zero one two three four five six seven eight nine".split(), strict=True))
ADVERBS = {"a": "again", "n": "now", "p": "please", "s": "soon"}
NAME = re.compile(r"[blps][bgrw][abiw][a-vx-z][z1-9][anps]")
"""A letter for each of the six words: command, colour, preposition, letter (there is no w), digit, adverb."""


def read_grid(directory: Path) -> RecordingFolder | None:
    """Return the recordings of one speaker's folder, or None if most videos directly in it are not named like GRID's.

    directory : with clips/ or the videos themselves; align/ or .align files beside the videos; the lists of the splits
    """
    clips = directory / "clips"
    files = video_files((clips if clips.is_dir() else directory).iterdir())
    if 2 * sum(words_of_name(path.stem) is not None for path in files) <= len(files):
        return None
    recordings, problems, speaker = [], {}, speaker_of_folder(directory.resolve().name)
    for path in files:
        try:
            recordings.append(SourceRecording(path.stem, path, _words(directory, path), rights=RIGHTS, speaker=speaker))
        except InputError as error:
            problems[path.stem] = str(error)
    return assign_splits(RecordingFolder(KIND, tuple(recordings), problems), directory)


def speaker_of_folder(folder: str) -> str:
    """Return the speaker that a folder is named after (``s1``, ``grid-s1``), or an empty text."""
    found = re.search(r"(?:^|[^a-z0-9])(s[1-9]\d?)$", folder.lower())
    return found[1] if found else ""


def words_of_name(name: str) -> tuple[str, ...] | None:
    """Return the six words that a GRID file name spells out, or None if it is not one."""
    if not NAME.fullmatch(name):
        return None
    command, colour, preposition, letter, digit, adverb = tuple(name)
    return (
        *(COMMANDS[command], COLOURS[colour], PREPOSITIONS[preposition]),
        *(letter, DIGITS[digit], ADVERBS[adverb]),
    )


def _words(directory: Path, video: Path) -> tuple[str, ...] | None:
    """Return the words of a video: from its word-time file, else from its name; None if neither gives them."""
    return aligned_words(video, (directory / "align", video.parent)) or words_of_name(video.stem)


def aligned_words(video: Path, folders: Iterable[Path]) -> tuple[str, ...] | None:
    """Return the words of a video from the first of some folders with its word-time file, or None.

    Raises InputError: as ``read_aligned_words``.
    """
    files = (folder / f"{video.stem}.align" for folder in folders)
    return next((read_aligned_words(path) for path in files if path.is_file()), None)


def read_aligned_words(path: Path) -> tuple[str, ...]:
    """Return the words of a word-time file: lines of start, end (unit 1/25000 s) and word.

    Raises InputError: not such a file, or without a word.
    """
    size = path.stat().st_size
    if size > LARGEST_ALIGNMENT_BYTES:
        raise InputError(
            f"{path}: {size} bytes, required at most {LARGEST_ALIGNMENT_BYTES}: are they the words of one sentence?"
        )
    rows = [line.split() for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    for number, row in enumerate(rows, 1):
        if len(row) != 3 or not re.fullmatch(r"[0-9]+ [0-9]+", " ".join(row[:2])):
            raise InputError(f"{path}: line {number} is {shortened(' '.join(row))!r}; required: start end word")
        if not WORD.fullmatch(row[2]):
            raise InputError(f"{path}: line {number} has {shortened(row[2])!r} where its word should be")
    words = tuple(row[2].lower() for row in rows if row[2].lower() not in SILENCES)
    if not words:
        raise InputError(f"{path}: holds no word; remove the file if the words are not known")
    return words
