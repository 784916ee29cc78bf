"""Sound that was recorded apart from the motion: which file it is, and by how much it is late where that is known."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

from lipmotion.corpora.source_recordings import AUDIO_SUFFIXES, RecordingFolder
from lipmotion.errors import CorpusError, InputError, shorten
from lipmotion.storage.files import read_text_file
from lipmotion.storage.text_table import read_table

RECORDER = ".recorder"
"""``take.recorder.wav`` is the sound that a recorder of its own made of ``take.mp4``, or of ``take.wav``."""
OFFSETS = "offsets.csv"
COLUMNS = ["name", "offset_ms"]
LARGEST_TABLE_BYTES = 1 << 22
LARGEST_OFFSET_S = 6 * 3600.0


def add_separate_sounds(
    folder: RecordingFolder, directory: Path, offset_s: float | None = None, *, is_whole: bool = True
) -> RecordingFolder:
    """Return the recordings with the sounds of their recorders, and with the offsets of the table ``offsets.csv``.

    offset_s : by how much the sound of each recording that is not in the table is late; None: that is not known
    is_whole : whether these are all recordings of the folder: names of the table without one then become problems
    Raises CorpusError: the table is damaged. Raises InputError: an offset that no recording has.
    """
    if offset_s is not None:
        _check(offset_s)
    table = read_offsets(directory / OFFSETS) if (directory / OFFSETS).is_file() else {}
    recordings, problems = [], dict(folder.problems)
    for recording in folder.recordings:
        stem = recording.file.with_suffix(RECORDER)
        sounds = [path for suffix in sorted(AUDIO_SUFFIXES) if (path := stem.with_name(stem.name + suffix)).is_file()]
        if len(sounds) > 1:
            what = f"{len(sounds)} recorders' sounds beside it: {', '.join(path.name for path in sounds)}"
            problems[recording.name] = f"{recording.file}: {what}; keep one"
            continue
        sound = sounds[0] if sounds else None
        recordings.append(replace(recording, recorder=sound, offset_s=table.get(recording.name, offset_s)))
    known = {recording.name for recording in folder.recordings} | problems.keys()
    problems |= {
        name: f"in {OFFSETS}, but there is no such recording" for name in table if is_whole and name not in known
    }
    return RecordingFolder(folder.kind, tuple(recordings), problems)


def is_of_recorder(path: Path) -> bool:
    """Return whether a file is the sound of a recorder, which is no recording of its own."""
    return path.suffix.lower() in AUDIO_SUFFIXES and path.stem.lower().endswith(RECORDER)


def read_offsets(path: Path) -> dict[str, float]:
    """Return by how many seconds the sound of each recording is late, from a table ``name,offset_ms``.

    Raises CorpusError: other columns, a row that is damaged, or a name twice.
    """
    try:
        table = read_table(io.StringIO(read_text_file(path, "table of offsets", LARGEST_TABLE_BYTES), newline=""))
        if table.plain_names != COLUMNS:
            raise InputError(f"{path}: the columns are {shorten(','.join(table.names))!r}, required name,offset_ms")
        offsets: dict[str, float] = {}
        for number, row in table.rows:
            name = row[0].strip().replace("/", "-")
            try:
                if len(row) != len(COLUMNS):
                    raise ValueError(f"{len(row)} fields")
                offset_s = float(row[1].replace(",", ".")) / 1000
            except ValueError as error:
                what = f"{path}: line {number}: {shorten(str(error))}"
                raise InputError(f"{what}, required a name and milliseconds") from error
            _check(offset_s)
            if offsets.setdefault(name, offset_s) != offset_s:
                raise InputError(f"{path}: line {number}: {shorten(name)!r} has another offset above; keep one")
    except ValueError as error:
        raise CorpusError(str(error)) from error
    return offsets


def _check(offset_s: float) -> None:
    if not abs(offset_s) <= LARGEST_OFFSET_S:
        raise InputError(f"the offset is {offset_s * 1000:g} ms, required within ±{LARGEST_OFFSET_S * 1000:.0f}")
