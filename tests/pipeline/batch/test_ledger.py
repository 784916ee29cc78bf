"""The ledger: what is known of lines after a kill at any moment."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from lipmotion.errors import ExportError
from lipmotion.pipeline.batch.ledger import DONE, Place, Record, opened_ledger, read_receipt, write_receipt
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.batch.settings import (
    BatchSettings,
    check_kinds,
    fingerprint_of,
    input_files,
    line_fingerprint,
)

CONTENT = b"motion"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


def record_of(line: BatchLine, run: str = "old") -> Record:
    inputs = [vars(each) for each in input_files(line)]
    return {
        "name": line.name,
        "recording": line.recording,
        "run": run,
        "fingerprint": line_fingerprint(line, "settings"),
        "outcome": DONE,
        "inputs": inputs,
        "outputs": {f"{line.name}.json": DIGEST},
    }


@pytest.fixture
def line(tmp_path: Path) -> BatchLine:
    (tmp_path / "a.wav").write_bytes(b"sound")
    return BatchLine("a", str(tmp_path / "a.wav"))


@pytest.fixture
def out(tmp_path: Path) -> Path:
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def written(out: Path) -> list[str]:
    return [json.loads(row)["name"] for row in (out / "batch.jsonl").read_bytes().splitlines()]


def test_a_line_is_kept_while_nothing_changes(line: BatchLine, out: Path) -> None:
    (out / "a.json").write_bytes(CONTENT)
    with opened_ledger(Place(str(out), "1")) as ledger:
        assert ledger.kept(line, "settings", out) is None
        ledger.append(record_of(line))
    with opened_ledger(Place(str(out), "2")) as ledger:
        assert ledger.kept(line, "settings", out) == record_of(line)
        assert ledger.kept(line, "other settings", out) is None
        Path(line.recording).touch()  # a new time, the same content
        assert ledger.kept(line, "settings", out) is not None
        Path(line.recording).with_suffix(".txt").write_text("words")  # a transcript has come
        assert ledger.kept(line, "settings", out) is None
        Path(line.recording).with_suffix(".txt").unlink()
        Path(line.recording).write_bytes(b"other")
        assert ledger.kept(line, "settings", out) is None
        Path(line.recording).write_bytes(b"sound")
        (out / "a.json").unlink()
        assert ledger.kept(line, "settings", out) is None
    assert sorted(path.name for path in out.iterdir()) == ["batch.jsonl"]


def test_a_row_that_was_cut_is_removed(line: BatchLine, out: Path) -> None:
    with opened_ledger(Place(str(out), "1")) as ledger:
        ledger.append(record_of(line))
    whole = (out / "batch.jsonl").read_bytes()
    (out / "batch.jsonl").write_bytes(whole + whole[:-40])
    with opened_ledger(Place(str(out), "2")) as ledger:
        assert ledger.record_of("a") == record_of(line)
    assert (out / "batch.jsonl").read_bytes() == whole


def test_a_damaged_row_is_passed_over(line: BatchLine, out: Path) -> None:
    with opened_ledger(Place(str(out), "1")) as ledger:
        ledger.append(record_of(line))
    whole = (out / "batch.jsonl").read_bytes()
    (out / "batch.jsonl").write_bytes(b'{"name": 3}\nnot JSON\n' + whole)
    with opened_ledger(Place(str(out), "2")) as ledger:
        assert ledger.record_of("a") == record_of(line)


@pytest.mark.parametrize("in_place", [True, False])
def test_killed_after_the_receipt(line: BatchLine, out: Path, in_place: bool) -> None:
    """Outputs that were renamed are entered into the ledger, once; others are forgotten."""
    old = Place(str(out), "old")
    old.receipt("a").parent.mkdir(parents=True)
    old.work("a").mkdir(parents=True)
    write_receipt(old.receipt("a"), record_of(line))
    (out / "a.json").write_bytes(CONTENT if in_place else b"of an earlier batch")
    with opened_ledger(Place(str(out), "new")) as ledger:
        assert (ledger.kept(line, "settings", out) is not None) == in_place
        assert not old.work("a").exists()
        assert read_receipt(old.receipt("a")) is None
    assert written(out) == ["a"] * in_place


def test_killed_after_the_ledger(line: BatchLine, out: Path) -> None:
    """A receipt that is in the ledger already is not entered twice."""
    place = Place(str(out), "old")
    (out / "a.json").write_bytes(CONTENT)
    with opened_ledger(place) as ledger:
        ledger.append(record_of(line))
    place.receipt("a").parent.mkdir(parents=True)
    write_receipt(place.receipt("a"), record_of(line))
    with opened_ledger(Place(str(out), "new")):
        pass
    assert written(out) == ["a"]


def test_a_later_run_ends_the_earlier_one(out: Path) -> None:
    first, second = Place(str(out), "1"), Place(str(out), "2")
    with opened_ledger(first):
        assert first.is_current()
        with pytest.raises(ExportError, match="at work on it"), opened_ledger(second):
            pass
        assert first.is_current()
    with opened_ledger(second):
        assert not first.is_current()


def test_settings_have_a_fingerprint(tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("a AH")
    plain = BatchSettings()
    assert fingerprint_of(plain) == fingerprint_of(BatchSettings())
    assert fingerprint_of(plain) != fingerprint_of(BatchSettings(recogniser="fast"))
    lexicon = BatchSettings(lexicon=str(tmp_path / "words.txt"))
    before = fingerprint_of(lexicon)
    (tmp_path / "words.txt").write_text("a EY")
    assert fingerprint_of(lexicon) != before


@pytest.mark.parametrize("kinds", [(), ("wav",), ("json", "json"), ("cues.json5",), ("",)])
def test_kinds_that_cannot_be_written(kinds: tuple[str, ...]) -> None:
    with pytest.raises(ExportError, match=r"required some of: json, csv|given twice"):
        check_kinds(kinds)
