from pathlib import Path

import pytest

from lipmotion.corpora.folder import discover
from lipmotion.corpora.source_recordings import add_separate_sounds, read_offsets
from lipmotion.errors import CorpusError, InputError


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    for name in ("a.wav", "a.csv", "a.recorder.flac", "b.mp4", "b.recorder.wav", "b.recorder.mp3", "anna/c.mov"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def test_a_recorder_belongs_to_its_recording(studio):
    (studio / "offsets.csv").write_text("name,offset_ms\nanna/c, -12.5\n\ngone,3\n")
    found = add_separate_sounds(discover(studio), studio, 0.1)
    assert [(item.name, item.recorder, item.offset_s) for item in found.recordings] == [
        ("a", studio / "a.recorder.flac", 0.1),
        ("anna-c", None, -0.0125),
    ]
    assert "2 recorders' sounds beside it: b.recorder.mp3, b.recorder.wav; keep one" in found.problems["b"]
    assert found.problems["gone"] == "in offsets.csv, but there is no such recording"


def test_one_video_of_many_has_its_own_row(studio):
    (studio / "offsets.csv").write_text("name,offset_ms\na,7\nothers,3\n")
    found = add_separate_sounds(discover(studio), studio, is_whole=False)
    assert found.recordings[0].offset_s == pytest.approx(0.007)
    assert "others" not in found.problems


def test_without_them_nothing_changes(studio):
    (studio / "a.recorder.flac").unlink()
    found = add_separate_sounds(discover(studio), studio)
    assert {(item.recorder, item.offset_s) for item in found.recordings} == {(None, None)}


def test_a_spreadsheet_writes_its_own_marks(tmp_path):
    (tmp_path / "offsets.csv").write_text("sep=;\nname;offset_ms;\nanna/c;-12,5\n;\n", encoding="utf-8-sig")
    assert read_offsets(tmp_path / "offsets.csv") == {"anna-c": pytest.approx(-0.0125)}


def test_what_is_wrong_with_a_table_is_said(tmp_path):
    for text, message in (
        ("", "the columns are '', required name,offset_ms"),
        ("name,offset_ms\na\n", "line 2: 1 fields, required a name and milliseconds"),
        ("name,offset_ms\na,soon\n", "line 2: could not convert"),
        ("name,offset_ms\na,nan\n", "the offset is nan ms"),
        ("name,offset_ms\na,1e12\n", "required within ±21600000"),
        ("name,offset_ms\na,1\na,2\n", "line 3: 'a' has another offset above"),
    ):
        (tmp_path / "offsets.csv").write_text(text)
        with pytest.raises(CorpusError, match=message):
            read_offsets(tmp_path / "offsets.csv")


def test_an_offset_of_a_day_is_refused(studio):
    with pytest.raises(InputError, match="required within"):
        add_separate_sounds(discover(studio), studio, 86_400.0)
