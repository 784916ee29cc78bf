import csv
import hashlib
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote

import pytest

from lipmotion import Job, Outputs, Request
from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.batch import BatchLine, read_lines, report
from lipmotion.pipeline.batch.ledger import (
    DONE,
    LARGEST_RECORD_BYTES,
    RECEIPTS,
    RUN,
    WORK,
    Place,
    Record,
    check_job,
    fingerprint_job,
    fingerprint_line,
    list_input_files,
    open_ledger,
    read_receipt,
    write_receipt,
)
from lipmotion.pipeline.batch.lines import MAX_LINES, OWN_FILES, OWN_FOLDER, check_names
from lipmotion.printable import printable
from lipmotion.storage.locks import LOCK

CONTENT = b"motion"
DIGEST = hashlib.sha256(CONTENT).hexdigest()


def record_of(line: BatchLine, run: str = "old") -> Record:
    inputs = [vars(each) for each in list_input_files(line)]
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
        assert ledger.find_same(line, "settings", out) is None
        ledger.append(record_of(line))
    with open_ledger(Place(str(out), "2"), [line]) as ledger:
        assert ledger.find_same(line, "settings", out) == record_of(line)
        assert ledger.find_same(line, "other settings", out) is None
        Path(line.recording).touch()  # a new time, the same content
        assert ledger.find_same(line, "settings", out) is not None
        Path(line.recording).with_suffix(".txt").write_text("words")  # a transcript has come
        assert ledger.find_same(line, "settings", out) is None
        Path(line.recording).with_suffix(".txt").unlink()
        Path(line.recording).write_bytes(b"other")
        assert ledger.find_same(line, "settings", out) is None
        Path(line.recording).write_bytes(b"sound")
        (out / "a.json").unlink()
        assert ledger.find_same(line, "settings", out) is None
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
        "outputs that are a list": {"outputs": ["a.json"]},
        "an output elsewhere": {"outputs": {"/dev/zero": "0"}},
        "a fingerprint that is a list": {"fingerprint": []},
        "another outcome": {"outcome": "perhaps"},
        "warnings that are a number": {"warnings": 3},
        "a huge number": {"widest": 10**400},
        "words without confidence": {"words": "words"},
    }
    rows = {what: json.dumps(record | change).encode() for what, change in changes.items()}
    row, name = json.dumps(record).encode(), b'{"name": "a", '
    return rows | {
        "nothing": b"",
        "no JSON": b"not JSON",
        "a name alone": b'{"name": "a"}',
        "not finite": name + b'"seconds": 1e999}',
        "not UTF-8": row.replace(b'"done"', b'"d\xffne"'),
        "its first half": row[: len(row) // 2],
        "two in one": row + row,
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
                assert ledger.find_same(line, "settings", out) is None, what
                report.write_reports([line], ledger, out)
                ledger.append(record_of(line))
                assert ledger.find_same(line, "settings", out) == record_of(line), what
            if "a line end" not in what:  # it is of a line that this batch has not: nobody looks at it
                (message,) = caplog.messages
                assert message.endswith(": 1 damaged rows are passed over; what they say was done is done again"), what
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
        assert (ledger.find_same(line, "settings", out) is not None) == in_place
        assert not old.work("a").exists()
        assert read_receipt(old.receipt("a")) is None
    assert written(out) == ["a"] * in_place
    if in_place:  # a receipt that is in the ledger already is not entered twice
        old.receipt("a").parent.mkdir(parents=True)
        write_receipt(old.receipt("a"), record_of(line))
        with open_ledger(Place(str(out), "newest"), [line]):
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
    (tmp_path / "A.png").write_text("a drawing")
    for parts, file, counts in (
        ({"outputs": Outputs(character=tmp_path / "head.glb")}, "head.glb.character.csv", True),
        ({"request": Request(lexicon=tmp_path / "words.txt")}, "words.txt", True),
        ({"outputs": Outputs(face=str(tmp_path))}, "A.png", True),
        ({"outputs": Outputs(face=str(tmp_path))}, "words.txt", False),  # no drawing
    ):
        before = fingerprint_job(Job(**parts))
        (tmp_path / file).write_text("control,source\n")
        assert (fingerprint_job(Job(**parts)) != before) == counts


@pytest.mark.parametrize("kinds", [(), ("wav",), ("json", "json"), ("cues.json5",), ("",)])
def test_kinds_that_cannot_be_written(kinds):
    with pytest.raises(ExportError, match=r"required some of: json, csv|given twice"):
        check_job(Job(outputs=Outputs(kinds=kinds)))


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
    assert report.rate_doubt(GOOD | worse) > report.rate_doubt(GOOD | better)
    assert report.rate_doubt(GOOD) == pytest.approx(0)
    assert report.rate_doubt(GOOD | {"words": "words", "confidence": 0.07}) > 60


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
        table, page = report.write_reports(lines, ledger, folder)
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
    assert [row[report.COLUMNS.index("error")] for row in rows] == [printable(hostile), None, None]
    assert rows[2][report.COLUMNS.index("mark") + 1] == ["a.json"]
    sound = unquote(rows[2][report.COLUMNS.index("mark") + 2])
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
    assert rows_of(page)[0][report.COLUMNS.index("mark") + 2] is None


def test_they_are_read_as_they_were_written(tmp_path):
    names = ("a", "=1+1", 'b, "c"', "'d", "'=e ")
    kinds, times = ("approve", "redo", "redo", "", ""), ("2026-01-01", "", "-2", "", "")
    marks = dict(zip(names, map(report.Mark, kinds, times), strict=True))
    report.write_marks(tmp_path / "marks.csv", marks)
    assert "'=1+1," in (tmp_path / "marks.csv").read_text()
    assert report.read_marks(tmp_path / "marks.csv") == marks


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
        report.read_marks(tmp_path / "marks.csv")


def test_a_line_is_due_once_for_each_mark():
    assert report.is_due(report.Mark("redo"), None)
    assert report.is_due(report.Mark("redo"), {})
    assert not report.is_due(report.Mark("redo"), {"redone": ""})
    assert report.is_due(report.Mark("redo", "2"), {"redone": ""})
    assert not report.is_due(report.Mark("approve"), {})


def listed(folder: Path, text: str, name: str = "list.txt", kinds: tuple[str, ...] = ("json",)) -> list[BatchLine]:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_lines(path, kinds)


def test_a_folder_gives_its_recordings_with_their_relative_names(tmp_path):
    for name in ("b/two.wav", "a/one.FLAC", "a/one.txt", ".hidden/x.wav", "a/.y.wav", "notes.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    lines = read_lines(tmp_path, ("json",))
    assert [line.name for line in lines] == ["a/one", "b/two"]
    assert [line.recording for line in lines] == [str(tmp_path / "a/one.FLAC"), str(tmp_path / "b/two.wav")]


def test_a_list_of_paths_some_outside_of_its_folder(tmp_path):
    lines = listed(tmp_path, "a/x, y.wav\n\n./b.wav\n")
    assert [line.name for line in lines] == ["a/x, y", "b"]
    assert lines[1].recording == str(tmp_path / "b.wav")
    (tmp_path / "lists").mkdir()
    lines = listed(tmp_path / "lists", f"../sounds/s1/a.wav\n{tmp_path}/sounds/s2/a.wav\n")
    assert [line.name for line in lines] == ["s1/a", "s2/a"]


@pytest.mark.parametrize(("name", "mark"), [("t.csv", ","), ("t.tsv", "\t"), ("t.csv", ";")])
def test_a_table(tmp_path, name, mark, caplog):
    header = mark.join(("File", "transcript", "output", "speaker", "note"))
    row = mark.join(("a.wav", '"Hello, you; there"', "act1/hello.json", "anna", "x"))
    lines = listed(tmp_path, f"{header}\n{row}", name)
    assert lines == [BatchLine("act1/hello", str(tmp_path / "a.wav"), "Hello, you; there", "anna")]
    assert "columns that are not used: note" in caplog.text


def test_outputs_may_be_named_with_the_suffix_of_one_of_their_kinds(tmp_path):
    text = "file,output\n1.wav,a.json\n2.wav,b.cues.json\n3.wav,c.take\n"
    lines = listed(tmp_path, text, "t.csv", ("json", "cues.json"))
    assert [line.name for line in lines] == ["a", "b", "c.take"]


def test_lists_that_are_refused(tmp_path):
    for source, message in ((tmp_path, "no recordings in it"), (tmp_path / "missing", "no such file or folder")):
        with pytest.raises(InputError, match=message):
            read_lines(source, ("json",))
    assert listed(tmp_path, "file,transcript\na.wav\n") == [BatchLine("a", str(tmp_path / "a.wav"))]
    assert listed(tmp_path, "~nobody/a.wav\n")[0].recording == str(tmp_path / "~nobody/a.wav")  # a shell knows homes
    same = "a.wav\na.flac\n", "a.wav\nA.wav\n", "a.wav\na.wav\n", "é.wav\ne\u0301.flac\n"
    for text, message in (
        ("\n", "no recordings"),
        ("file,transcript\na.wav,hello,you\n", "row 2: 3 columns, required at most the 2"),
        ("file,transcript\na.wav,x\n,hello\n", "row 3: no recording in the column 'file'"),
        ("a.wav\n" * (MAX_LINES + 1), f"{MAX_LINES + 1} lines, required at most {MAX_LINES}"),
        *((text, "control characters") for text in ("a\0b.wav\n", "file,output\na.wav,x\ty\n")),
        *((text, "rename the recording") for text in same),
    ):
        with pytest.raises(ExportError if text in same else InputError, match=message):
            listed(tmp_path, text)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a", "a.json/b"], "be the folder of"),
        (["B.JSON/b", "b"], "be the folder of"),
        (["report.csv/b"], "be the folder of"),
        (["x" * 251], "more than 255 bytes"),
        (["é" * 130 + "/x"], "more than 255 bytes"),
        (["take.LiveLink"], "would be a .livelink.csv"),
        (["Report"], "the batch itself"),
        (["a", "a.cues"], "would be written for"),  # as json and as cues.json
        *(([name], "outside the folder") for name in ("../a", "/a", ".a", "a/.batch/b", "")),
        *(([name], "Windows") for name in ("CON", "nul", "a/aux", "aux/a", "com1.take", "NUL .b", "a./b", "a /b")),
    ],
)
def test_names_that_cannot_be_files_together(names, message):
    with pytest.raises(ExportError, match=message):
        check_names([BatchLine(name, f"/{n}.wav") for n, name in enumerate(names)], ("json", "csv", "cues.json"))


def test_names_that_are_only_alike():
    names = ["a", "a.jso/b", "a/b", "x" * 240, "take.1", "take.livelink.2"]
    check_names([BatchLine(name, f"/{name}.wav") for name in names], ("json", "csv", "livelink.csv"))
    check_names([BatchLine(name, "/a.wav") for name in ("take.livelink", "report", "a", "a.cues")], ("json",))


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such time")
def test_another_file_of_the_same_size_and_time_is_noticed(tmp_path):
    path, other = tmp_path / "a.wav", tmp_path / "b.wav"
    path.write_bytes(b"a")
    (file,) = list_input_files(BatchLine("a", str(path)))
    path.touch()
    assert file.is_unchanged()
    other.write_bytes(b"b")
    status = path.stat()
    other.replace(path)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert not file.is_unchanged()


def test_words_of_all_in_one_table_count_unless_a_recording_has_its_own(tmp_path):
    path, table, own = tmp_path / "wavs" / "a.wav", tmp_path / "metadata.csv", tmp_path / "wavs" / "a.txt"
    path.parent.mkdir()
    for file in (path, table):
        file.write_bytes(b"a")
    assert {each.path for each in list_input_files(BatchLine("a", str(path)))} == {str(path), str(table)}
    own.write_bytes(b"a")
    assert {each.path for each in list_input_files(BatchLine("a", str(path)))} == {str(path), str(own)}
