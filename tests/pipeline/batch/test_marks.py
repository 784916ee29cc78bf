"""Marks: what a table of them may hold, and that it is read as it was written."""

from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.pipeline.batch.marks import Mark, is_due, merge_marks, read_marks, write_marks


def test_they_are_read_as_they_were_written(tmp_path: Path) -> None:
    marks = {
        "a": Mark("approve", "2026-01-01"),
        "=1+1": Mark("redo"),
        'b, "c"': Mark("redo", "-2"),
        "'d": Mark(""),
        "'=e ": Mark(""),
    }
    write_marks(tmp_path / "marks.csv", marks)
    assert "'=1+1," in (tmp_path / "marks.csv").read_text()
    assert read_marks(tmp_path / "marks.csv") == marks


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name\na\n", "no column 'mark'"),
        ("name,mark\na,again\n", "row 2: the mark is 'again', required approve or redo"),
        ("name,mark\na,redo\na,approve\n", "row 3: 'a' is marked twice"),
        ("", "no column 'name'"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "marks.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_marks(tmp_path / "marks.csv")


def test_later_marks_are_ahead_and_may_take_back() -> None:
    kept = {"a": Mark("approve"), "b": Mark("redo"), "c": Mark("approve")}
    assert merge_marks(kept, {"a": Mark("redo", "2"), "b": Mark("")}) == {"a": Mark("redo", "2"), "c": Mark("approve")}


def test_a_line_is_due_once_for_each_mark() -> None:
    assert is_due(Mark("redo"), None)
    assert is_due(Mark("redo"), {})
    assert not is_due(Mark("redo"), {"redone": ""})
    assert is_due(Mark("redo", "2"), {"redone": ""})
    assert not is_due(Mark("approve"), {})
