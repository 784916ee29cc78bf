"""The report of a batch: a table of all lines as CSV, and as one HTML file that needs no network."""

from __future__ import annotations

import csv
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.batch.ledger import FAILED, Ledger, Record
from lipmotion.pipeline.batch.lines import LARGEST_LIST_BYTES, BatchLine
from lipmotion.printable import printable
from lipmotion.speech.recognition.recognised_speech import NOISY_DB
from lipmotion.storage.files import as_text, atomic_file
from lipmotion.storage.json_text import as_json
from lipmotion.storage.text_table import as_field, from_field, read_whole_table
from lipmotion.types.generation import FULL_FIT_SHARE, SURE_CONFIDENCE

APPROVE, REDO, NO_MARK = "approve", "redo", ""
KINDS = (APPROVE, REDO, NO_MARK)
MARKS = "marks.csv"  # where a folder of outputs has its marks
MARK_COLUMNS = ("name", "mark", "when")


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
    names, rows = read_whole_table(path, "file of marks", LARGEST_LIST_BYTES, MARK_COLUMNS)
    missing = [name for name in MARK_COLUMNS[:2] if name not in names]
    if missing:
        raise InputError(f"{path}: no column {missing[0]!r}; required a first row name,mark (and when, if you like)")
    for number, fields in rows:
        row = dict(zip(names, fields, strict=False))
        name, kind, when = (from_field(row.get(column, "")) for column in MARK_COLUMNS)
        kind = kind.strip().lower()
        if kind not in KINDS:
            raise InputError(f"{path}, row {number}: the mark is {shorten(kind)!r}, required approve or redo")
        if name in marks:
            raise InputError(f"{path}, row {number}: {shorten(name)!r} is marked twice; remove one of the rows")
        marks[name] = Mark(kind, when)
    return marks


def write_marks(path: Path, marks: Mapping[str, Mark]) -> None:
    """Write marks as a table that ``read_marks`` reads. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(MARK_COLUMNS)
        rows.writerows([as_field(text) for text in (name, mark.kind, mark.when)] for name, mark in marks.items())


def is_due(mark: Mark, record: Record | None) -> bool:
    """Return whether a line must be done again because of its mark: not where it was done because of the same one."""
    return mark.kind == REDO and (record is None or record.get("redone") != mark.when)


CSV_REPORT, HTML_REPORT = "report.csv", "report.html"
COLUMNS = (
    "name outcome doubt duration_s words confidence voice motion least_sure_s closures_heard closures_made widest "
    "range_db warnings advice error seconds recording outputs heard width mark"
).split()
"""Columns of the table, in order; docs/batch.md says what they mean."""
UNSURE_WORDS, UNSURE_PHONES = 80.0, 25.0
"""Doubt of words of which nothing is sure, and of sounds that were recognised without words."""
ROWS, BETWEEN = "/*ROWS*/", " | "
"""Where the page has its rows; what stands between several texts in a field of the CSV file."""
SHARED_COLOURS = "/*COLOURS*/"
BASIS = "/*BASIS*/"  # where the page has the digest of the marks that it shows


def write_reports(
    lines: Sequence[BatchLine], ledger: Ledger, out: Path, marks: Mapping[str, Mark] | None = None
) -> tuple[Path, Path]:
    """Write the reports of some lines into a folder, the most doubtful line first; return their paths.

    Raises ExportError: they cannot be written.
    Memory: a number and a reference a line; the records are read one by one.
    """
    doubts = [rate_doubt(ledger.record_of(line.name) or {}) for line in lines]
    order = sorted(range(len(lines)), key=lambda number: (-doubts[number], lines[number].name))
    table, page = out / CSV_REPORT, out / HTML_REPORT
    marks = marks or {}
    page_text = insert_colours(resources.files(__package__).joinpath("report_page.html").read_text("utf-8"))
    rows_of_marks = as_json([[name, mark.kind, mark.when] for name, mark in marks.items()])
    page_text = page_text.replace(BASIS, hashlib.sha256(rows_of_marks.encode()).hexdigest())
    before, _, after = page_text.partition(ROWS)
    with ExitStack() as stack:
        paths = [stack.enter_context(atomic_file(path)) for path in (table, page)]
        table_file = stack.enter_context(paths[0].open("w", encoding="utf-8", newline=""))
        page_file = stack.enter_context(paths[1].open("w", encoding="utf-8"))
        rows = csv.writer(table_file)
        rows.writerow(COLUMNS)
        page_file.write(before)
        for place, number in enumerate(order):
            record = ledger.record_of(lines[number].name) or {"name": lines[number].name, "outcome": "missing"}
            mark = marks.get(record["name"])
            if mark is not None and mark.kind != APPROVE and not is_due(mark, record):
                mark = None  # what it asked for is done
            outputs = list(record.get("outputs", ()))
            record |= {"doubt": rate_doubt(record), "outputs": outputs, "mark": mark.kind if mark else None}
            values = [record.get(name) for name in COLUMNS]
            rows.writerow([_field(value) for value in values])
            page_file.write(f"{',' if place else ''}\n{_show_on_page(record, values, out, mark)}")
        page_file.write(after)
    return table, page


def rate_doubt(record: Record) -> float:
    """Return how much a line deserves to be looked at, 0 (nothing is known against it) to 100 (it failed)."""
    if record.get("outcome") in (FAILED, None):
        return 100.0
    words, closures = record.get("words"), record.get("closures_heard") or 0
    doubt = 50.0 if words == "no speech" else 0.0
    doubt += 10 * len(record.get("warnings", ()))
    doubt += 5 * (record.get("range_db", NOISY_DB) < NOISY_DB)
    if words in ("words", "phones"):
        weight = UNSURE_WORDS if words == "words" else UNSURE_PHONES
        doubt += weight * max(SURE_CONFIDENCE - record["confidence"], 0) / SURE_CONFIDENCE
    if words in ("transcript", "mapped transcript", "given units") and record["confidence"] < FULL_FIT_SHARE:
        doubt += UNSURE_WORDS * (1 - record["confidence"])
    if (motion := record.get("motion")) is not None:
        doubt += 5 * (1 - motion)
    if closures:
        doubt += 5 * (1 - record["closures_made"] / closures)
    return round(min(doubt, 99.0), 1)


def _field(value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, list | str):
        return str(value)
    return as_field(BETWEEN.join(value) if isinstance(value, list) else value)


def _show_on_page(record: Record, values: Sequence[Any], out: Path, mark: Mark | None) -> str:
    """Return a row of the page: its values, the addresses of outputs and recording, and when it was marked."""
    links, address = [quote(as_text(name)) for name in record["outputs"]], None
    with suppress(KeyError, ValueError):  # a recording on another drive has no address
        recording = os.fsencode(os.path.relpath(record["recording"], out))
        address = quote(recording.replace(os.sep.encode(), b"/"))
    row = [*map(_visible, values), links, address, mark.when if mark else None]
    text = json.dumps(row, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c")  # nothing that a name says ends the script


def _visible(value: Any) -> Any:
    """Return a value of which nothing is invisible, as on a terminal: marks that turn a name around are shown."""
    if isinstance(value, list):
        return [printable(text) for text in value]
    return printable(value) if isinstance(value, str) else value


def insert_colours(style: str) -> str:
    """Return a style with the colours of all pages, light and dark, in the place of ``SHARED_COLOURS``."""
    return style.replace(SHARED_COLOURS, resources.files(__package__).joinpath("colours.css").read_text("utf-8"))
