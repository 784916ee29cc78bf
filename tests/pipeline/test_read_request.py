from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.analysis.read_request import read_text_or_file
from lipmotion.pipeline.job import is_for_several, list_recordings, plan_outputs
from lipmotion.types import TimedTranscript


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("here")
def test_a_text_is_itself() -> None:
    texts = ["hello there", "see p. 3", "", "α" * 3000, "a/b/c", "the file words.txt", "..", "\n"]
    for text in (*texts, "é" * 130, "é" * 130 + ".abc", "你好.世界", "a" * 300 + ".txt"):
        assert read_text_or_file(text) == text


def test_a_file_is_its_content(here: Path) -> None:
    (here / "words").write_text("näh\n", encoding="utf-8-sig")
    assert read_text_or_file("words") == "näh\n"


def test_a_file_deep_in_folders(here: Path) -> None:
    deep = here / ("a" * 200) / ("b" * 200)
    deep.mkdir(parents=True)
    (deep / "words.txt").write_text("hello")
    assert read_text_or_file(str(deep / "words.txt")) == "hello"


def test_subtitles_keep_their_times(here: Path) -> None:
    (here / "words.srt").write_text("1\n00:00:01,000 --> 00:00:02,500\n<i>Hello</i> there\n")
    transcript = read_text_or_file("words.srt")
    assert isinstance(transcript, TimedTranscript)
    assert transcript.words == ("hello", "there")
    assert (transcript.lines[0].start_s, transcript.lines[0].end_s) == pytest.approx((1.0, 2.5))


def test_a_name_in_a_folder_that_exists_is_no_text(here: Path) -> None:
    (here / "subs").mkdir()
    for name in ("subs/nofile", "./nofile", "../nofile", "subs/../nofile", "nofile.txt"):
        with pytest.raises(InputError, match=r"nofile(\.txt)?: no such transcript file"):
            read_text_or_file(name)
    assert read_text_or_file("either/or") == "either/or"
    assert read_text_or_file("subs/ nofile") == "subs/ nofile"
    assert read_text_or_file("x" * 5000 + "/a") == "x" * 5000 + "/a"


def test_a_file_that_is_not_text(here: Path) -> None:
    (here / "words.txt").write_bytes(b"\x81\xfe")
    with pytest.raises(InputError, match=r"words.txt: not a readable UTF-8 transcript"):
        read_text_or_file("words.txt")


def test_files_stay_in_order_and_folders_are_listed(tmp_path: Path) -> None:
    for name in ("b.wav", "a.MP4", "notes.txt"):
        (tmp_path / name).touch()
    assert list_recordings([Path("z.wav"), tmp_path]) == [Path("z.wav"), tmp_path / "a.MP4", tmp_path / "b.wav"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no sounds and no videos in it"):
        list_recordings([tmp_path / "empty"])


def test_folders_and_templates(tmp_path: Path) -> None:
    planned = plan_outputs([Path("in/a.wav"), Path("b.c.flac")], ["out/", "x/{name}-take.mp4"], ["json", "csv"])
    assert planned == [["out/a.json", "out/a.csv", "x/a-take.mp4"], ["out/b.c.json", "out/b.c.csv", "x/b.c-take.mp4"]]
    assert is_for_several(str(tmp_path))
    assert not is_for_several("a.json")


def test_outputs_that_would_be_written_twice() -> None:
    with pytest.raises(ExportError, match=r"o/a\.json: would be written for x/a\.wav and for y/a\.wav"):
        plan_outputs([Path("x/a.wav"), Path("y/a.wav")], ["o/"], ["json"])
    with pytest.raises(ExportError, match=r"a\.json: is one file, and there are 2 recordings"):
        plan_outputs([Path("a.wav"), Path("b.wav")], ["a.json"], ["json"])


@pytest.mark.parametrize("output", ["out/", "{name}.json", "out/{name}/a.json"])
def test_a_recording_that_is_called_as_a_device_names_no_output(output: str) -> None:
    for name in ("CON.wav", "nul .flac"):
        with pytest.raises(ExportError, match="Windows"):
            plan_outputs([Path(name)], [output], ["json"])
    assert plan_outputs([Path("CON.wav")], ["../a.json"], ["json"]) == [["../a.json"]]
