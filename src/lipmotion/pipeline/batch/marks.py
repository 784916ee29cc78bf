"""Marks of a batch: which lines are approved, and which are to be done again; a table that people edit, too."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.batch.ledger import Record
from lipmotion.pipeline.batch.lines import LARGEST_LIST_BYTES
from lipmotion.storage.files import atomic_file, read_text_file
from lipmotion.storage.text_table import as_field, from_field, read_table

APPROVE, REDO, NO_MARK = "approve", "redo", ""
KINDS = (APPROVE, REDO, NO_MARK)
MARKS = "marks.csv"
"""Where a folder of outputs has its marks."""
COLUMNS = ("name", "mark", "when")


@dataclass(frozen=True)
class Mark:
    """What somebody decided of a line.

    kind : ``APPROVE``, ``REDO``, or ``NO_MARK``: an earlier mark is taken back
    when : any text; a line is done again once for each one of a ``REDO``
    """

    kind: str
    when: str = ""


def read_marks(path: Path) -> dict[str, Mark]:
    """Return the marks in a file, by the names of their lines.

    path : a table whose first row names the columns ``name`` and ``mark`` and, if there is, ``when``
    Raises InputError: the file cannot be read, lacks a column, or has an unknown mark, or two marks of one line.
    """
    marks: dict[str, Mark] = {}
    try:
        table = read_table(io.StringIO(read_text_file(path, "file of marks", LARGEST_LIST_BYTES), newline=""))
        missing = [name for name in COLUMNS[:2] if name not in table.plain_names]
        if missing:
            raise InputError(
                f"{path}: no column {missing[0]!r}; required a first row name,mark (and when, if you like)"
            )
        for number, fields in table.rows:
            row = dict(zip(table.plain_names, fields, strict=False))
            name, kind, when = (from_field(row.get(column, "")) for column in COLUMNS)
            kind = kind.strip().lower()
            if kind not in KINDS:
                raise InputError(f"{path}, row {number}: the mark is {shorten(kind)!r}, required approve or redo")
            if name in marks:
                raise InputError(f"{path}, row {number}: {shorten(name)!r} is marked twice; remove one of the rows")
            marks[name] = Mark(kind, when)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a readable table ({error}); export it again as CSV") from error
    return marks


def write_marks(path: Path, marks: Mapping[str, Mark]) -> None:
    """Write marks as a table that ``read_marks`` reads. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        rows.writerows([as_field(text) for text in (name, mark.kind, mark.when)] for name, mark in marks.items())


def merge_marks(kept: Mapping[str, Mark], given: Mapping[str, Mark]) -> dict[str, Mark]:
    """Return marks with later ones in their place; of lines whose mark was taken back, none."""
    return {name: mark for name, mark in {**kept, **given}.items() if mark.kind}


def is_due(mark: Mark, record: Record | None) -> bool:
    """Return whether a line must be done again because of its mark: not where it was done because of the same one."""
    return mark.kind == REDO and (record is None or record.get("redone") != mark.when)
