"""Lists and folders of recordings, and the names of their outputs."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.batch import BatchLine, read_lines
from lipmotion.pipeline.batch import lines as lines_module
from lipmotion.pipeline.batch.ledger import input_files
from lipmotion.pipeline.batch.lines import check_names


def listed(folder: Path, text: str, name: str = "list.txt", kinds: tuple[str, ...] = ("json",)) -> list[BatchLine]:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_lines(path, kinds)


def test_a_folder_gives_its_recordings_with_their_relative_names(tmp_path: Path) -> None:
    for name in ("b/two.wav", "a/one.FLAC", "a/one.txt", ".hidden/x.wav", "a/.y.wav", "notes.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    lines = read_lines(tmp_path, ("json",))
    assert [line.name for line in lines] == ["a/one", "b/two"]
    assert [line.recording for line in lines] == [str(tmp_path / "a/one.FLAC"), str(tmp_path / "b/two.wav")]


def test_a_list_of_paths(tmp_path: Path) -> None:
    lines = listed(tmp_path, "a/x, y.wav\n\n./b.wav\n")
    assert [line.name for line in lines] == ["a/x, y", "b"]
    assert lines[1].recording == str(tmp_path / "b.wav")


def test_recordings_outside_of_the_folder_of_the_list(tmp_path: Path) -> None:
    (tmp_path / "lists").mkdir()
    lines = listed(tmp_path / "lists", f"../sounds/s1/a.wav\n{tmp_path}/sounds/s2/a.wav\n")
    assert [line.name for line in lines] == ["s1/a", "s2/a"]


@pytest.mark.parametrize(("name", "mark"), [("t.csv", ","), ("t.tsv", "\t"), ("t.csv", ";")])
def test_a_table(tmp_path: Path, name: str, mark: str, caplog: pytest.LogCaptureFixture) -> None:
    rows = [
        ["File", "transcript", "output", "speaker", "note"],
        ["a.wav", '"Hello, you; there"', "act1/hello.json", "anna", "x"],
    ]
    with caplog.at_level(logging.WARNING):
        lines = listed(tmp_path, "\n".join(mark.join(row) for row in rows), name)
    assert lines == [BatchLine("act1/hello", str(tmp_path / "a.wav"), "Hello, you; there", "anna")]
    assert "columns that are not used: note" in caplog.text


def test_outputs_may_be_named_with_the_suffix_of_one_of_their_kinds(tmp_path: Path) -> None:
    names = ("a.json", "b.cues.json", "c.take")
    text = "file,output\n" + "".join(f"{number}.wav,{name}\n" for number, name in enumerate(names))
    lines = listed(tmp_path, text, "t.csv", ("json", "cues.json"))
    assert [line.name for line in lines] == ["a", "b", "c.take"]


def test_short_rows_are_filled_and_long_ones_refused(tmp_path: Path) -> None:
    assert listed(tmp_path, "file,transcript\na.wav\n") == [BatchLine("a", str(tmp_path / "a.wav"))]
    with pytest.raises(InputError, match="row 2: 3 columns, required at most the 2"):
        listed(tmp_path, "file,transcript\na.wav,hello,you\n")
    with pytest.raises(InputError, match="row 3: no recording in the column 'file'"):
        listed(tmp_path, "file,transcript\na.wav,x\n,hello\n")


def test_nothing_to_do_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no recordings in it"):
        read_lines(tmp_path, ("json",))
    with pytest.raises(InputError, match="no such file or folder"):
        read_lines(tmp_path / "missing", ("json",))
    with pytest.raises(InputError, match="no recordings"):
        listed(tmp_path, "\n")


@pytest.mark.parametrize("text", ["a.wav\na.flac\n", "a.wav\nA.wav\n", "a.wav\na.wav\n", "é.wav\ne\u0301.flac\n"])
def test_two_lines_with_one_name_are_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ExportError, match="rename one of them"):
        listed(tmp_path, text)


@pytest.mark.parametrize("name", ["../a", "/a", ".a", "a/.batch/b", ""])
def test_outputs_stay_in_their_folder(name: str) -> None:
    with pytest.raises(ExportError, match="outside the folder"):
        check_names([BatchLine(name, "a.wav")], ("json",))


@pytest.mark.parametrize("text", ["a\0b.wav\n", "file,output\na.wav,x\ty\n", "~nobody/a.wav\n"])
def test_names_that_no_file_has(tmp_path: Path, text: str) -> None:
    if text.startswith("~"):  # only a shell knows homes
        assert listed(tmp_path, text)[0].recording == str(tmp_path / "~nobody/a.wav")
        return
    with pytest.raises(InputError, match="control characters"):
        listed(tmp_path, text)


def test_the_files_of_the_batch_itself_are_no_outputs() -> None:
    check_names([BatchLine("report", "a.wav")], ("json",))
    with pytest.raises(ExportError, match="the batch itself"):
        check_names([BatchLine("Report", "a.wav")], ("json", "csv"))


def test_kinds_do_not_meet() -> None:
    """``a.cues`` as ``json`` is what ``a`` is as ``cues.json``."""
    lines = [BatchLine("a", "a.wav"), BatchLine("a.cues", "b.wav")]
    with pytest.raises(ExportError, match="would be written for"):
        check_names(lines, ("json", "cues.json"))
    check_names(lines, ("json",))


def test_a_list_of_too_many_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines_module, "MAX_LINES", 2)
    assert len(listed(tmp_path, "a.wav\nb.wav\n")) == 2
    with pytest.raises(InputError, match="3 lines, required at most 2"):
        listed(tmp_path, "a.wav\nb.wav\nc.wav\n")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a", "a.json/b"], "be the folder of"),
        (["B.JSON/b", "b"], "be the folder of"),
        (["report.csv/b"], "be the folder of"),
        (["x" * 251], "more than 255 bytes"),
        (["é" * 130 + "/x"], "more than 255 bytes"),
        (["take.LiveLink"], "would be called as .livelink.csv"),
    ],
)
def test_names_that_cannot_be_files_together(names: list[str], message: str) -> None:
    with pytest.raises(ExportError, match=message):
        check_names([BatchLine(name, f"/{number}.wav") for number, name in enumerate(names)], ("json", "csv"))


def test_names_that_are_only_alike() -> None:
    names = ["a", "a.jso/b", "a/b", "x" * 240, "take.1", "take.livelink.2"]
    check_names([BatchLine(name, f"/{name}.wav") for name in names], ("json", "csv", "livelink.csv"))
    check_names([BatchLine("take.livelink", "/a.wav")], ("json",))


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such time")
def test_another_file_of_the_same_size_and_time_is_noticed(tmp_path: Path) -> None:
    path, other = tmp_path / "a.wav", tmp_path / "b.wav"
    path.write_bytes(b"a")
    (file,) = input_files(BatchLine("a", str(path)))
    path.touch()
    assert file.is_unchanged()
    other.write_bytes(b"b")
    status = path.stat()
    other.replace(path)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert not file.is_unchanged()


@pytest.mark.parametrize("name", ["CON", "nul", "a/aux", "aux/a", "com1.take", "NUL .b", "a./b", "a /b"])
def test_names_that_windows_does_not_take(name: str) -> None:
    with pytest.raises(ExportError, match="Windows"):
        check_names([BatchLine(name, "a.wav")], ("json",))
