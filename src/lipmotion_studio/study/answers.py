"""Answers of raters, as a table that spreadsheets and statistics programs read: one row for each judgement."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.storage.files import atomic_file
from lipmotion.storage.sources import read_text_file
from lipmotion.storage.text_table import as_field, from_field
from lipmotion.types.values import parse_number, parse_whole

PAIRED, MOS = KINDS = ("paired", "mos")
FIRST, SECOND = "first", "second"  # values of a paired comparison: which of the two videos was preferred
RECORDING = "recording"  # the condition that is the real recording, hidden among the others
ANCHOR = "anchor"
"""The condition whose lips are out of step with the sound on purpose: who does not see that does not watch."""
HIGHEST_MOS = 5


@dataclass(frozen=True)
class Answer:
    """One judgement of a rater.

    rater      : name of the rater in this study, which says nothing of the person
    kind       : ``paired`` or ``mos``
    trial      : number of the trial in the order in which this rater saw them, from 0
    sentence   : what is said in the videos
    question   : what was asked: ``preference``, or a scale such as ``smoothness``
    condition  : what was judged; in a pair, what was shown first
    other      : in a pair, what was shown second; otherwise empty
    value      : ``first`` or ``second`` of a pair; 1 to 5 for ``mos``
    seconds    : from the start of the trial to the answer
    plays      : how often the videos of the trial were played to their ends
    practice   : whether it was a trial for practice, which does not count
    expected   : the value that an attentive rater gives, in a trial that checks attention; otherwise empty
    """

    rater: str
    kind: str
    trial: int
    sentence: str
    question: str
    condition: str
    other: str
    value: str
    seconds: float
    plays: int
    practice: bool
    expected: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"an answer of the kind {shorten(self.kind)!r}, required one of {', '.join(KINDS)}")
        if not is_possible(self.kind, self.value):
            raise InputError(f"the answer {shorten(self.value)!r}, required {POSSIBLE[self.kind]}")


POSSIBLE = {PAIRED: f"{FIRST!r} or {SECOND!r}", MOS: f"a whole number from 1 to {HIGHEST_MOS}"}


def is_possible(kind: str, value: str) -> bool:
    """Return whether a value can be the answer to a question of a kind."""
    if kind == PAIRED:
        return value in (FIRST, SECOND)
    return value.isascii() and value.isdecimal() and len(value) <= 3 and 1 <= int(value) <= HIGHEST_MOS


COLUMNS = tuple(field.name for field in fields(Answer))


def write_answers(path: Path, answers: Iterable[Answer]) -> None:
    """Write a table of answers. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary:
        file = io.StringIO()
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for answer in answers:
            row = asdict(answer) | {"practice": int(answer.practice)}
            table.writerow({name: as_field(value) if isinstance(value, str) else value for name, value in row.items()})
        temporary.write_text(file.getvalue(), encoding="utf-8", newline="")


def read_answers(path: Path) -> list[Answer]:
    """Return the answers of a table. Raises InputError: it cannot be read, lacks a column, or has a wrong value."""
    table, answers = csv.DictReader(io.StringIO(read_text_file(path, "answers")), restval=""), []
    try:
        missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
        if missing:
            raise InputError(f"no column {missing[0]!r}; required {', '.join(COLUMNS)}")
        for row in table:
            names = ("rater", "kind", "sentence", "question", "condition", "other", "value")
            answer = Answer(
                **{name: from_field(row[name]) for name in names},
                trial=parse_whole(row["trial"], "trial is"),
                seconds=parse_number(row["seconds"], "seconds is"),
                plays=parse_whole(row["plays"], "plays is"),
                practice=bool(parse_whole(row["practice"], "practice is")),
                expected=row["expected"],
            )
            answers.append(answer)
    except (InputError, csv.Error) as error:
        raise InputError(f"{path}: line {table.line_num}: {error}") from error
    return answers
