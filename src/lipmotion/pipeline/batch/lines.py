"""The lines of a batch: one recording each, from a list or a folder, with the names of their outputs."""

from __future__ import annotations

import io
import logging
import os
import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lipmotion.errors import ExportError, InputError, shorten_list
from lipmotion.formats.base import list_suffixes
from lipmotion.storage.files import make_portable
from lipmotion.storage.sources import check_listable, is_recording, read_text_file
from lipmotion.storage.text_table import parse_text_table

LOG = logging.getLogger("lipmotion")
FILE_COLUMNS = ("file", "path", "recording", "audio", "wav")
"""Names of the column with the recording; the first row of a table is a header if it has one of them."""
COLUMNS = ("transcript", "output", "speaker")  # names of the other columns that are read
OWN_FILES = ("batch.jsonl", "report.csv", "report.html", "marks.csv")
"""Files of the batch itself, in the folder of its lines' outputs."""
OWN_FOLDER = ".batch"  # folder of unfinished work in the folder of the outputs
LARGEST_LIST_BYTES, MAX_LINES = 1 << 27, 200_000
"""Maximum bytes of a list, and lines of a batch: the words of a very long game."""
LONGEST_PART_BYTES = 255  # maximum bytes of the name of a file or a folder, on usual file systems
MAX_NAMED_LINES = 3
RENAME = "give another name in a column 'output' of the list, or rename the recording"
CONTROL = re.compile(r"[\x00-\x1f]")


@dataclass(frozen=True)
class BatchLine:
    """One recording of a batch.

    name       : relative path of its outputs without their suffixes, with ``/`` between folders; unique in the batch
    recording  : absolute path of the sound or the video
    transcript : the words; empty: those of a file beside the recording, if there is one
    speaker    : whose motion; empty: that of the whole batch
    """

    name: str
    recording: str
    transcript: str = ""
    speaker: str = ""


def read_lines(source: Path, kinds: Sequence[str]) -> list[BatchLine]:
    """Return the lines of a folder of recordings, or of a list of them, in their order.

    source : a folder, which is searched with its sub-folders; or a file: a path a line, or a table (``.csv``, ``.tsv``)
             whose first row names the columns ``file`` and, if there are, ``transcript``, ``output``, ``speaker``.
             Relative paths begin at the folder of the list
    kinds  : suffixes of the outputs without the first dot, for the check of their names
    Raises InputError: no such file or folder, no recordings, or a table with a row that is not usable.
    Raises ExportError: two lines would have the same output, or one would lie outside the folder of the outputs.
    """
    if source.is_dir():
        check_listable(source)
        lines = []
        for root, folders, names in os.walk(source):
            folders[:] = (name for name in folders if not name.startswith("."))
            for path in (Path(root) / name for name in sorted(names) if not name.startswith(".")):
                if is_recording(path) and path.is_file():
                    inner = path.relative_to(source).with_suffix("").as_posix()
                    lines.append(BatchLine(inner, os.path.abspath(path)))  # noqa: PTH100 # links are not followed
        lines.sort(key=lambda line: line.name)
    elif source.exists():
        lines = _read_list(source, kinds)
    else:
        raise InputError(f"{source}: no such file or folder; give a list of recordings, or a folder of them")
    if not lines:
        raise InputError(f"{source}: no recordings in it; required at least one")
    _check_count(source, len(lines))
    check_names(lines, kinds)
    return lines


def check_names(lines: Iterable[BatchLine], kinds: Sequence[str]) -> None:
    """Raise ExportError if two outputs of a batch would be the same file, also where case does not count.

    Also if one would be the folder of another, if a name is too long for a file system, or if it makes a file one of
    another format: ``take.livelink`` with the kind ``csv``.
    Raises InputError: a name holds control characters.
    """
    taken = dict.fromkeys(OWN_FILES, "the batch itself")
    folders: dict[str, str] = {}
    longer = {kind: [each for each in list_suffixes() if each[1:].endswith(f".{kind}")] for kind in kinds}
    for line in lines:
        if CONTROL.search(line.name + line.recording):
            raise InputError(f"{line.recording!r}, {line.name!r}: control characters in a name; rename the recording")
        path, output = PurePosixPath(line.name), f"{line.recording}: the output {line.name!r}"
        is_inside = path.name and not path.is_absolute() and ".." not in path.parts
        if not is_inside or str(path) != line.name or any(part.startswith(".") for part in path.parts):
            required = "required a relative name without '..', '//' and leading dots"
            raise ExportError(f"{output} lies outside the folder of the outputs, or is hidden; {required}")
        device = next((part for part in (*path.parts[:-1], f"{path.name}.x") if make_portable(part) != part), None)
        if device is not None:
            raise ExportError(f"{output} is called as a device of Windows, or ends with a dot or a blank; {RENAME}")
        for folder in path.parents[:-1]:
            folders[file_key(str(folder))] = line.recording
        for kind in kinds:
            file = f"{line.name}.{kind}"
            if any(len(os.fsencode(part)) > LONGEST_PART_BYTES for part in file.split("/")):
                raise ExportError(f"{output}: a part of its name has more than {LONGEST_PART_BYTES} bytes; {RENAME}")
            other = next((each for each in longer[kind] if file.lower().endswith(each)), None)
            if other is not None:
                raise ExportError(f"{output} would be a {other} by its name; give {other[1:]} as the kind, or {RENAME}")
            key = file_key(file)
            if key in taken:
                raise ExportError(f"{file}: would be written for {taken[key]} and for {line.recording}; {RENAME}")
            taken[key] = line.recording
    for key in folders.keys() & taken.keys():
        raise ExportError(f"{key}: a file for {taken[key]} would be the folder of {folders[key]}; {RENAME}")


def file_key(name: str) -> str:
    """Return a name without differences of case and of the form of accents: equal keys are one file on some systems."""
    return unicodedata.normalize("NFD", unicodedata.normalize("NFD", name).casefold())


def _read_list(source: Path, kinds: Sequence[str]) -> list[BatchLine]:
    text = read_text_file(source, "list of recordings", LARGEST_LIST_BYTES)
    _check_count(source, max(map(text.count, "\n\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029")))
    rows = _read_table(source, text)
    if rows is None:
        rows = [{"file": row.strip()} for row in text.splitlines() if row.strip()]
    suffixes = [f".{kind}" for kind in sorted(kinds, key=len, reverse=True)]
    base = os.path.dirname(os.path.abspath(source))  # noqa: PTH100, PTH120 # texts: there may be many
    paths, names = [], []
    for row in rows:
        paths.append(os.path.normpath(os.path.join(base, row["file"])))  # noqa: PTH118
        name = row.get("output", "").strip().replace("\\", "/")
        name = name.removesuffix(next((suffix for suffix in suffixes if name.endswith(suffix)), ""))
        names.append(str(PurePosixPath(name)) if name else "")
    folders = {os.path.dirname(path) for path, name in zip(paths, names, strict=True) if not name}  # noqa: PTH120
    try:  # names of outputs are counted from the folder of the list, if it holds all recordings
        shared = os.path.commonpath([base, *folders])
        shared = shared if shared == base or not folders else os.path.commonpath(list(folders))
    except ValueError as error:  # several drives
        raise InputError("the recordings are on several drives; name the outputs in a column 'output'") from error
    lines = []
    for row, path, name in zip(rows, paths, names, strict=True):
        inner = os.path.splitext(path[len(shared) :].lstrip(os.sep))[0].replace(os.sep, "/")  # noqa: PTH122
        lines.append(BatchLine(name or inner, path, row.get("transcript", ""), row.get("speaker", "")))
    return lines


def _check_count(source: Path, count: int) -> None:
    if count > MAX_LINES:
        raise InputError(f"{source}: {count} lines, required at most {MAX_LINES} in one batch; divide the list")


def _read_table(source: Path, text: str) -> list[dict[str, str]] | None:
    """Return the rows of a table with a header by the names of its columns; None: it has no header."""
    try:
        table = parse_text_table(io.StringIO(text, newline=""))
        header = [name.lower() for name in table.names]
        file = next((name for name in header if name in FILE_COLUMNS), None)
        if file is None:
            return None
        cells_of = list(table.rows)
    except ValueError as error:
        raise InputError(f"{source}: not a readable table ({error}); export it again as CSV") from error
    if unused := [name for name in header if name and name != file and name not in COLUMNS]:
        names = shorten_list(unused, MAX_NAMED_LINES)
        LOG.warning("%s: columns that are not used: %s; used are %s", source, names, ", ".join((file, *COLUMNS)))
    rows = []
    for number, cells in cells_of:
        if len(cells) > len(header):
            found = f"{len(cells)} columns, required at most the {len(header)} of the header"
            raise InputError(f"{source}, row {number}: {found}; put texts with commas into quotes")
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=False)}
        if not row.get(file):
            raise InputError(f"{source}, row {number}: no recording in the column {file!r}; fill it in, or remove it")
        rows.append({"file": row[file]} | {name: row.get(name, "") for name in COLUMNS})
    return rows
