from pathlib import Path

import pytest

from lipmotion.corpora.folder import discover
from lipmotion.errors import CorpusError, InputError


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_videos_of_any_kind_are_found(tmp_path):
    touch(tmp_path, "b.MP4", "a.mov", "day 1/c.webm", "notes.pdf", "speech.wav", ".cache/d.mp4", ".part-e.mkv")
    found = discover(tmp_path)
    assert found.kind == "folder of videos"
    assert [item.name for item in found.recordings] == ["a", "b", "day 1-c"]
    assert [item.words for item in found.recordings] == [None, None, None]
    assert {item.split for item in found.recordings} == {"train"}


def test_transcripts_lie_beside_the_videos(tmp_path):
    touch(tmp_path, "a.mp4", "sub/b.mp4", "c.mp4", "d.mp4", "e.mp4")
    for name, content in (
        ("a.txt", "﻿Hello, World! It’s 3 o'clock — naïve.\n".encode()),
        ("sub/b.txt", b"Nothing.\n"),
        ("c.txt", b"\n"),
        ("d.txt", b"na\x81ve"),
        ("e.txt", "naïve".encode("cp1252")),
    ):
        (tmp_path / name).write_bytes(content)
    found = discover(tmp_path)
    assert {item.name: item.words for item in found.recordings} == {
        "a": ("hello", "world", "it's", "three", "o'clock", "naïve"), "c": None, "e": ("naïve",), "sub-b": ("nothing",),
    }  # fmt: skip
    assert "not a readable UTF-8" in found.problems["d"]


def test_subtitles_and_recognised_words_are_transcripts(tmp_path):
    touch(tmp_path, "a.mp4", "b.mp4", "c.mp4")
    (tmp_path / "a.srt").write_text("1\n00:00:00,500 --> 00:00:02,000\n<i>Hello</i> there\n")
    (tmp_path / "b.json").write_text('{"segments": [{"start": 0.5, "end": 2.0, "text": " Hello you."}]}')
    (tmp_path / "c.srt").write_text("1\n00:00:00,500 --> 2\nHello\n")
    found = discover(tmp_path)
    assert [item.words for item in found.recordings] == [("hello", "there"), ("hello", "you")]
    assert "c.srt: line 2 is '00:00:00,500 --> 2'" in found.problems["c"]


def test_recordings_of_the_same_name_are_reported(tmp_path):
    touch(tmp_path, "a.mp4", "a.mkv", "b.mp4", "anna/a.mp4", "anna-a.mp4")
    found = discover(tmp_path)
    assert [item.name for item in found.recordings] == ["b"]
    for name in ("a", "anna-a"):
        assert "2 recordings share this name" in found.problems[name]


def test_lists_give_the_splits_and_are_not_transcripts(tmp_path):
    touch(tmp_path, "a.mp4", "test.mp4", "sub/b.mp4")
    (tmp_path / "test.txt").write_text("test\n\nsub/b\n")
    items = {item.name: item for item in discover(tmp_path).recordings}
    assert {name: item.split for name, item in items.items()} == {"a": "train", "test": "test", "sub-b": "test"}
    assert items["test"].words is None


def test_recordings_outside_of_the_lists_are_left_out(tmp_path):
    touch(tmp_path, "a.mp4", "b.mp4", "c.mp4")
    (tmp_path / "train.txt").write_text("a\n")
    (tmp_path / "val.txt").write_text("b\nlost\n")
    found = discover(tmp_path)
    assert {item.name: item.split for item in found.recordings} == {"a": "train", "b": "val"}
    assert "in none of the lists" in found.problems["c"]
    assert found.problems["lost"] == "listed in val.txt, but there is no such recording"
    (tmp_path / "test.txt").write_text("a\n")
    with pytest.raises(CorpusError, match=r"a is in train\.txt and in test\.txt"):
        discover(tmp_path)


def test_nothing_to_find(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        discover(tmp_path / "none")
    touch(tmp_path, "speech.wav")
    with pytest.raises(CorpusError, match=r"no videos in it, and no sounds with motion .*required: .*\.mp4"):
        discover(tmp_path)


def test_sounds_with_motion_beside_them(tmp_path):
    touch(tmp_path, "a.wav", "a.csv", "b.flac", "b.npz", "c.WAV", "c.json", "alone.wav", "d.wav", "d.csv", "d.json")
    touch(tmp_path, "a.recorder.wav", "a.recorder.csv")  # sounds of recorders are no recordings
    found = discover(tmp_path)
    assert found.kind == "folder of sounds with motion"
    read = [(item.file.name, item.motion_file and item.motion_file.file.name) for item in found.recordings]
    assert read == [("a.wav", "a.csv"), ("b.flac", "b.npz"), ("c.WAV", "c.json")]
    assert "2 motion files beside it" in found.problems["d"]


def test_a_video_is_tracked_whatever_lies_beside_it(tmp_path):
    touch(tmp_path, "a.mp4", "a.csv", "b.wav", "b.csv")
    found = discover(tmp_path)
    assert found.kind == "folder of videos, and of sounds with motion"
    assert [item.motion_file is None for item in found.recordings] == [True, False]


def test_a_folder_is_a_speaker(tmp_path):
    touch(tmp_path, "anna/a.mp4", "anna/day 2/a.mp4", "ben/a.mp4", "c.mp4", "ben/s.wav", "ben/s.json")
    (tmp_path / "test.txt").write_text("ben/a\n")
    found = discover(tmp_path)
    assert [(item.name, item.speaker, item.split) for item in found.recordings] == [
        ("anna-a", "anna", "train"),
        ("anna-day 2-a", "anna", "train"),
        ("ben-a", "ben", "test"),
        ("ben-s", "ben", "train"),
        ("c", "", "train"),
    ]


def test_labels_are_kept_and_bad_ones_are_reported(tmp_path):
    touch(tmp_path, "a.mp4", "b.mp4", "c.mp4")
    (tmp_path / "a.lab").write_text("0 1000000 t\n1000000 2000000 uw\n")
    (tmp_path / "b.lab").write_text("0 1000000 t\n500000 2000000 uw\n")
    found = discover(tmp_path)
    assert [item.name for item in found.recordings] == ["a", "c"]
    assert [span.label.phone for span in found.recordings[0].phones] == ["t", "uw"]
    assert "line 2 starts at 0.05 s" in found.problems["b"]


def test_a_take_of_live_link_face_is_the_motion_of_its_video(tmp_path):
    touch(tmp_path, "take.mov", "other.mp4", "other.csv", "talk.wav", "talk.c3d")
    (tmp_path / "take.csv").write_text("Timecode,BlendShapeCount,JawOpen\n")
    (tmp_path / "other.csv").write_text("time_s,opening\n")
    found = {item.name: item.motion_file and item.motion_file.file.name for item in discover(tmp_path).recordings}
    assert found == {"take": "take.csv", "other": None, "talk": "talk.c3d"}
