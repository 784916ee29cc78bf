import hashlib
import json
import os
import sys
from pathlib import Path

import pytest

from lipmotion import Job, Outputs, Request
from lipmotion.errors import ExportError
from lipmotion.pipeline.batch import BatchLine
from lipmotion.pipeline.batch import ledger as settings
from lipmotion.pipeline.batch.ledger import (
    DONE,
    LARGEST_RECORD_BYTES,
    RECEIPTS,
    RUN,
    WORK,
    Place,
    Record,
    check_kinds,
    fingerprint_job,
    fingerprint_line,
    input_files,
    open_ledger,
    read_receipt,
    write_receipt,
)
from lipmotion.pipeline.batch.lines import OWN_FILES, OWN_FOLDER
from lipmotion.pipeline.batch.report import write_reports
from lipmotion.storage.locks import LOCK

CONTENT = b"motion"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


def record_of(line: BatchLine, run: str = "old") -> Record:
    inputs = [vars(each) for each in input_files(line)]
    return {
        "name": line.name, "recording": line.recording, "run": run, "fingerprint": fingerprint_line(line, "settings"),
        "outcome": DONE, "inputs": inputs, "outputs": {f"{line.name}.json": DIGEST},
    }  # fmt: skip


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


def test_a_line_is_kept_while_nothing_changes(line, out):
    (out / "a.json").write_bytes(CONTENT)
    with open_ledger(Place(str(out), "1"), [line]) as ledger:
        assert ledger.kept(line, "settings", out) is None
        ledger.append(record_of(line))
    with open_ledger(Place(str(out), "2"), [line]) as ledger:
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


def test_a_row_that_was_cut_is_removed(line, out):
    with open_ledger(Place(str(out), "1"), [line]) as ledger:
        ledger.append(record_of(line))
    whole = (out / "batch.jsonl").read_bytes()
    (out / "batch.jsonl").write_bytes(whole + whole[:-40])
    with open_ledger(Place(str(out), "2"), [line]) as ledger:
        assert ledger.record_of("a") == record_of(line)
    assert (out / "batch.jsonl").read_bytes() == whole


def damaged(record: Record) -> dict[str, bytes]:
    """Return rows that are nearly the record's."""
    changes: dict[str, dict[str, object]] = {
        "a name that is a number": {"name": 1},
        "a name with a line end": {"name": "a\nb", "outputs": {"a\nb.json": "0"}},
        "inputs that are a number": {"inputs": 5},
        "inputs that are texts": {"inputs": ["a"]},
        "an input with one field": {"inputs": [{"path": "a"}]},
        "an input whose size is a text": {"inputs": [{**record["inputs"][0], "size": "5"}]},
        "outputs that are null": {"outputs": None},
        "outputs that are a list": {"outputs": ["a.json"]},
        "an output elsewhere": {"outputs": {"/dev/zero": "0"}},
        "an output whose digest is a number": {"outputs": {"a.json": 1}},
        "a fingerprint that is a list": {"fingerprint": []},
        "another outcome": {"outcome": "perhaps"},
        "an outcome that is a list": {"outcome": []},
        "warnings that are a number": {"warnings": 3},
        "a range that is a text": {"range_db": "loud"},
        "a motion that is a text": {"motion": "sure"},
        "a huge number": {"widest": 10**400},
        "words without confidence": {"words": "words"},
        "closures heard, none made": {"closures_heard": 2},
    }
    rows = {what: json.dumps(record | change).encode() for what, change in changes.items()}
    row, name = json.dumps(record).encode(), b'{"name": "a", '
    return rows | {
        "nothing": b"",
        "no JSON": b"not JSON",
        "a list": b"[]",
        "a name alone": b'{"name": "a"}',
        "deep nesting": name + b'"outputs": ' + b"[" * 100_000,
        "a number of 5000 digits": name + b'"seconds": ' + b"1" * 5000 + b"}",
        "not finite": name + b'"seconds": 1e999}',
        "not UTF-8": row.replace(b'"done"', b'"d\xffne"'),
        "NUL": row.replace(b'"done"', b'"d\0ne"'),
        "its first half": row[: len(row) // 2],
        "its second half": row[len(row) // 2 :],
        "two in one": row + row,
        "a key twice": row.replace(b'"run"', b'"name"'),
        "too long": row + b" " * LARGEST_RECORD_BYTES,
        "half an escape": row.replace(b'"old"', b'"\\ud8"'),
    }


def test_damaged_rows_are_said_once_and_their_lines_done_again(line, out, caplog):
    (out / "a.json").write_bytes(CONTENT)
    good = json.dumps(record_of(line)).encode() + b"\n"
    for what, row in damaged(record_of(line)).items():
        for others in (b"", good.replace(b'"a', b'"b') * 2):
            (out / "batch.jsonl").write_bytes(others + row + b"\n")
            caplog.clear()
            with open_ledger(Place(str(out), "2"), [line]) as ledger:
                assert ledger.kept(line, "settings", out) is None, what
                write_reports([line], ledger, out)
                ledger.append(record_of(line))
                assert ledger.kept(line, "settings", out) == record_of(line), what
            if "a line end" not in what:  # it is of a line that this batch has not: nobody looks at it
                assert [said.getMessage().split("batch.jsonl: ")[1] for said in caplog.records] == [
                    "1 damaged rows are passed over; what they say was done is done again"
                ], what
            assert (out / "batch.jsonl").read_bytes() == others + row + b"\n" + good, what


@pytest.mark.skipif(sys.platform == "win32", reason="links, pipes and devices as POSIX has them")
def test_what_is_no_file_of_a_batch_is_refused(line, out):
    """A batch writes into its folder alone, and waits for nobody."""
    elsewhere = out.parent / "elsewhere"
    (elsewhere / "work").mkdir(parents=True)
    (elsewhere / "file").write_bytes(b"precious")
    aims = [elsewhere, elsewhere / "file", elsewhere / "nothing", Path("/dev/zero"), Path("itself")]
    for name in (*OWN_FILES, OWN_FOLDER, *(f"{OWN_FOLDER}/{name}" for name in (LOCK, RECEIPTS, RUN, WORK))):
        path = out / name
        path.parent.mkdir(exist_ok=True)
        for aim in [*aims, None]:
            if aim is None:
                if path.parent.name == OWN_FOLDER:
                    continue
                os.mkfifo(path)
            else:
                path.symlink_to(path if aim.name == "itself" else aim)
            with pytest.raises(ExportError, match=rf"{name}: is a (link|file)"):
                open_ledger(Place(str(out), "1"), [line]).__enter__()
            path.unlink()
    assert (elsewhere / "file").read_bytes() == b"precious"
    assert sorted(path.name for path in elsewhere.iterdir()) == ["file", "work"]


@pytest.mark.parametrize("in_place", [True, False])
def test_killed_after_the_receipt(line, out, in_place):
    """Outputs that were renamed are entered into the ledger, once; others are forgotten."""
    old = Place(str(out), "old")
    old.receipt("a").parent.mkdir(parents=True)
    old.work("a").mkdir(parents=True)
    write_receipt(old.receipt("a"), record_of(line))
    (out / "a.json").write_bytes(CONTENT if in_place else b"of an earlier batch")
    with open_ledger(Place(str(out), "new"), [line]) as ledger:
        assert (ledger.kept(line, "settings", out) is not None) == in_place
        assert not old.work("a").exists()
        assert read_receipt(old.receipt("a")) is None
    assert written(out) == ["a"] * in_place


def test_killed_after_the_ledger(line, out):
    """A receipt that is in the ledger already is not entered twice."""
    place = Place(str(out), "old")
    (out / "a.json").write_bytes(CONTENT)
    with open_ledger(place, [line]) as ledger:
        ledger.append(record_of(line))
    place.receipt("a").parent.mkdir(parents=True)
    write_receipt(place.receipt("a"), record_of(line))
    with open_ledger(Place(str(out), "new"), [line]):
        pass
    assert written(out) == ["a"]


def test_a_later_run_ends_the_earlier_one(out):
    first, second = Place(str(out), "1"), Place(str(out), "2")
    with open_ledger(first, []):
        assert first.is_current()
        with pytest.raises(ExportError, match="at work on it"), open_ledger(second, []):
            pass
        assert first.is_current()
    with open_ledger(second, []):
        assert not first.is_current()


def test_settings_have_a_fingerprint(tmp_path):
    (tmp_path / "words.txt").write_text("a AH")
    plain = Job()
    assert fingerprint_job(plain) == fingerprint_job(Job())
    assert fingerprint_job(plain) != fingerprint_job(Job(Request(recogniser="fast")))
    own = Job(outputs=Outputs(character=tmp_path / "head.glb"))
    before = fingerprint_job(own)
    (tmp_path / "head.glb.character.csv").write_text("control,source\n")
    assert fingerprint_job(own) != before
    lexicon = Job(Request(lexicon=tmp_path / "words.txt"))
    before = fingerprint_job(lexicon)
    (tmp_path / "words.txt").write_text("a EY")
    assert fingerprint_job(lexicon) != before
    (tmp_path / "A.png").write_text("a drawing")
    drawn = Job(outputs=Outputs(face=str(tmp_path)))
    before = fingerprint_job(drawn)
    (tmp_path / "words.txt").write_text("a AY")
    assert fingerprint_job(drawn) == before
    (tmp_path / "A.png").write_text("another one")
    assert fingerprint_job(drawn) != before


def test_a_line_without_the_recogniser_of_phones_is_another_one(monkeypatch):
    found = set()
    for name in ("hama", None):
        monkeypatch.setattr(settings, "installed_phone_recogniser", lambda name=name: name)
        found.add(fingerprint_job(Job()))
    assert len(found) == 2


@pytest.mark.parametrize("kinds", [(), ("wav",), ("json", "json"), ("cues.json5",), ("",)])
def test_kinds_that_cannot_be_written(kinds):
    with pytest.raises(ExportError, match=r"required some of: json, csv|given twice"):
        check_kinds(kinds)
