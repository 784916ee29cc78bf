import csv
import json
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote

import pytest

from lipmotion.errors import InputError
from lipmotion.pipeline.batch import BatchLine
from lipmotion.pipeline.batch.ledger import Place, open_ledger
from lipmotion.pipeline.batch.report import (
    COLUMNS,
    Mark,
    is_due,
    merge_marks,
    rate_doubt,
    read_marks,
    write_marks,
    write_reports,
)
from lipmotion.printable import printable

GOOD = {"outcome": "done", "words": "transcript", "confidence": 1.0, "range_db": 50.0, "warnings": []}
GOOD |= {"closures_heard": 2, "closures_made": 2, "duration_s": 1.5, "seconds": 0.1, "advice": []}


@pytest.mark.parametrize(
    ("worse", "better"),
    [
        ({"outcome": "failed"}, {"words": "no speech"}),
        ({"words": "no speech"}, {"warnings": ["a"]}),
        ({"warnings": ["a", "b"]}, {"warnings": ["a"]}),
        ({"words": "words", "confidence": 0.3}, {"words": "words", "confidence": 0.6}),
        ({"words": "phones", "confidence": 0.1}, {"words": "words", "confidence": 0.6}),
        ({"confidence": 0.5}, {"confidence": 0.9}),
        ({"range_db": 10.0}, {}),
        ({"closures_made": 1}, {}),
        ({"motion": 0.3}, {"motion": 0.6}),
    ],
)
def test_what_is_doubtful(worse, better):
    assert rate_doubt(GOOD | worse) > rate_doubt(GOOD | better)
    assert rate_doubt(GOOD) == pytest.approx(0)
    assert rate_doubt(GOOD | {"words": "words", "confidence": 0.07}) > 60


def rows_of(page: str) -> list[list]:
    return json.loads(page.partition('id="data">')[2].partition("</script>")[0])


def reported(folder: Path, names: Sequence[str], *records: dict) -> tuple[list[dict[str, str]], str]:
    """Write the reports of lines, of which the first have these records; return the rows of the table, and the page."""
    lines = [BatchLine(name, f"/x/{name}.wav") for name in names]
    base = GOOD | {"run": "1", "fingerprint": "f", "inputs": []}
    with open_ledger(Place(str(folder), "1"), lines) as ledger:
        for line, record in zip(lines, records, strict=False):
            own = {"name": line.name, "recording": line.recording, "outputs": {f"{line.name}.json": "0"}}
            ledger.append(base | own | record)
        table, page = write_reports(lines, ledger, folder)
    with table.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file)), page.read_text(encoding="utf-8")


def test_both_reports_hold_all_lines(tmp_path):
    hostile = "</script><b>=1+1\u202e,\"'\n"
    read, text = reported(tmp_path, ["a", "b/c", "d"], {}, {"outcome": "failed", "error": hostile, "outputs": {}})
    assert [row["name"] for row in read] == ["b/c", "d", "a"]
    assert [row["outcome"] for row in read] == ["failed", "missing", "done"]
    assert read[0]["error"] == hostile
    assert read[2]["outputs"] == "a.json"
    rows = rows_of(text)
    assert [row[COLUMNS.index("error")] for row in rows] == [printable(hostile), None, None]
    assert rows[2][COLUMNS.index("mark") + 1] == ["a.json"]
    sound = unquote(rows[2][COLUMNS.index("mark") + 2])
    assert (tmp_path / sound).resolve() == Path("/x/a.wav")
    assert text.count("</script>") == 2
    assert "default-src 'none'" in text
    assert "http" not in text.replace("http-equiv", "")


@pytest.mark.parametrize("name", ["=1+1", "+a", "-a", "@a"])
def test_no_text_is_a_formula(tmp_path, name):
    (row,), page = reported(tmp_path, [name], {"range_db": -3.0, "warnings": [name, "a"]})
    assert (row["name"], row["outputs"], row["warnings"]) == (f"'{name}", f"'{name}.json", f"'{name} | a")
    assert row["range_db"] == "-3.0"
    assert rows_of(page)[0][0] == name


@pytest.mark.parametrize("recording", ["", "/\ud800.wav"])
def test_a_recording_without_an_address_is_not_played(tmp_path, recording):
    _, page = reported(tmp_path, ["a"], {"recording": recording})
    assert rows_of(page)[0][COLUMNS.index("mark") + 2] is None


def test_they_are_read_as_they_were_written(tmp_path):
    marks = {
        "a": Mark("approve", "2026-01-01"), "=1+1": Mark("redo"), 'b, "c"': Mark("redo", "-2"), "'d": Mark(""),
        "'=e ": Mark(""),
    }  # fmt: skip
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
def test_what_is_refused(tmp_path, text, said):
    (tmp_path / "marks.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_marks(tmp_path / "marks.csv")


def test_later_marks_are_ahead_and_may_take_back():
    kept = {"a": Mark("approve"), "b": Mark("redo"), "c": Mark("approve")}
    assert merge_marks(kept, {"a": Mark("redo", "2"), "b": Mark("")}) == {"a": Mark("redo", "2"), "c": Mark("approve")}


def test_a_line_is_due_once_for_each_mark():
    assert is_due(Mark("redo"), None)
    assert is_due(Mark("redo"), {})
    assert not is_due(Mark("redo"), {"redone": ""})
    assert is_due(Mark("redo", "2"), {"redone": ""})
    assert not is_due(Mark("approve"), {})
