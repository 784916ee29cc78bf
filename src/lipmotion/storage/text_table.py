"""Tables of text as programs and spreadsheets save them.

Fields stand between commas, semicolons or tabs, with or without quotes; numbers have a point or a comma. A byte order
mark, blank lines, comments (``#``) and Excel's ``sep=;`` may stand above the names of the columns.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.printable import is_formula
from lipmotion.storage.files import as_text
from lipmotion.storage.sources import read_text_file

LONGEST_LINE = 1 << 20  # most characters of a line
SEPARATORS = ",;\t"
MISSING = frozenset("|nan|na|n/a|#n/a|none|null|-|--|-nan|nan(ind)|-nan(ind)|1.#qnan|1.#ind|-1.#ind".split("|"))
"""Fields that hold no number, in lower case."""
QUOTE = "'"
Rows = list[tuple[int, list[str]]]  # rows of a table: the number of the last line of each, and its fields


def as_field(text: str) -> str:
    """Return a text as a field that people open with spreadsheets: what would be executed gets an apostrophe first."""
    text = as_text(text)
    return QUOTE + text if is_formula(text.lstrip(QUOTE)) else text


def from_field(field: str) -> str:
    """Return the text of a field that ``as_field`` made."""
    return field[1:] if field.startswith(QUOTE) and is_formula(field.lstrip(QUOTE)) else field


@dataclass(frozen=True)
class TextTable:
    """The names of the columns, and the rows below: each with the number of its last line, and its fields.

    Names have no blanks around them; empty names and fields at the end, as of lines that end in a comma, are left out.
    """

    names: list[str]
    rows: Iterator[tuple[int, list[str]]]


@contextmanager
def open_table(path: Path) -> Iterator[TextTable]:
    """Open a table to read its rows, without empty ones. Raises OSError, InputError: it is no table of numbers."""
    with path.open("rb") as file:
        start = file.read(2)
    encoding = "utf-16" if start in {b"\xff\xfe", b"\xfe\xff"} else "utf-16-le" if start[1:] == b"\0" else "utf-8-sig"
    with path.open(encoding=encoding, newline="") as text:
        try:
            yield parse_text_table(iter(partial(text.readline, LONGEST_LINE), ""))
        except (ValueError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"not a table of numbers under a header ({error}); export it again") from error


def parse_text_table(lines: Iterable[str]) -> TextTable:
    """Return the table in some lines, with their ends. Raises ValueError, also from the rows: it is none."""
    lines = iter(lines)
    above, head, separator = 0, "", ""
    for head in lines:
        stated = re.match(r'"?sep=([,;\t])', head)
        separator = stated[1] if stated else separator
        if not (stated or head.startswith("#") or not head.strip(SEPARATORS + '" \r\n')):
            break
        above += 1
    bare = re.sub(r'"[^"]*"', "", head)
    reader = csv.reader(chain([head], lines), delimiter=separator or max(SEPARATORS, key=bare.count))
    names = [name.strip() for name in next(_rows(reader, above, 1), (0, [""]))[1]]
    return TextTable(names, _rows(reader, above, len(names)))


def _rows(reader: Iterator[list[str]], above: int, columns: int) -> Iterator[tuple[int, list[str]]]:
    try:
        for row in reader:
            while len(row) > columns and not row[-1].strip():
                row.pop()
            if any(map(str.strip, row)):
                yield above + reader.line_num, row  # type: ignore[attr-defined]
    except csv.Error as error:
        raise ValueError(str(error)) from error


def parse_numbers(fields: Sequence[str], line: int) -> list[float]:
    """Return fields as numbers; those that are missing are NaN. Raises ValueError: another text, with its line."""
    written = "".join(fields)
    if "_" in written or not written.isascii():  # as 1_0, or digits of other scripts, which Python reads
        raise ValueError(f"line {line}: required numbers in the digits 0 to 9")
    with suppress(ValueError):
        return list(map(float, fields))
    try:
        return [float("nan") if f.strip().lower() in MISSING else float(f.replace(",", ".")) for f in fields]
    except ValueError as error:
        raise ValueError(f"line {line}: {error}") from error


def read_whole_table(path: Path, kind: str, largest: int, required: Sequence[str]) -> tuple[list[str], Rows]:
    """Return columns and rows of a table; ``required``: columns for messages. Raises InputError: it is no table."""
    text = read_text_file(path, kind, largest)
    try:
        table = parse_text_table(io.StringIO(text, newline=""))
        return table.names, list(table.rows)
    except ValueError as error:
        raise InputError(f"{path}: no readable table ({shorten(str(error))}); required {','.join(required)}") from error
