import json
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import CorpusError, InputError
from lipmotion.types import Channel
from lipmotion_faces.corpus.captured_faces import read_bare_motion, read_channels
from lipmotion_faces.corpus.folder import discover, read_aligned_words, spell_name
from lipmotion_faces.corpus.source_recordings import MotionFile, add_separate_sounds, read_offsets


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


def test_recordings_of_the_same_name_are_reported(tmp_path):
    touch(tmp_path, "a.mp4", "a.mkv", "b.mp4", "anna/a.mp4", "anna-a.mp4")
    found = discover(tmp_path)
    assert [item.name for item in found.recordings] == ["b"]
    for name in ("a", "anna-a"):
        assert "2 recordings share this name" in found.problems[name]


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
    touch(tmp_path, "both/a.mp4", "both/a.csv", "both/b.wav", "both/b.csv")  # a video is tracked all the same
    found = discover(tmp_path / "both")
    assert found.kind == "folder of videos, and of sounds with motion"
    assert [item.motion_file is None for item in found.recordings] == [True, False]


def test_a_folder_is_a_speaker(tmp_path):
    touch(tmp_path, "anna/a.mp4", "anna/day 2/a.mp4", "ben/a.mp4", "c.mp4", "ben/s.wav", "ben/s.json")
    (tmp_path / "test.txt").write_text("ben/a\n")
    found = discover(tmp_path)
    items = [(item.name, item.speaker, item.split) for item in found.recordings]
    assert items[:3] == [("anna-a", "anna", "train"), ("anna-day 2-a", "anna", "train"), ("ben-a", "ben", "test")]
    assert items[3:] == [("ben-s", "ben", "train"), ("c", "", "train")]


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


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    for folder in ("clips", "align"):
        (tmp_path / folder).mkdir()
    for name in ("brwa3s", "swiz9n", "lgazzp"):
        (tmp_path / "clips" / f"{name}.mkv").touch()
    (tmp_path / "align" / "brwa3s.align").write_text("0 15750 sil\n15750 21500 bin\n21500 22000 sp\n22000 30000 RED\n")
    return tmp_path


def test_only_file_names_of_the_corpus_spell_sentences():
    for name, words in (
        ("brwa3s", "bin red with a three soon"),
        ("swiz9n", "set white in z nine now"),
        ("lgazzp", "lay green at z zero please"),
        ("pbbc1a", "place blue by c one again"),
    ):
        assert spell_name(name) == tuple(words.split())
    for name in ("brwa3", "brww3s", "brwa0s", "xrwa3s", "brwa3s2", "BRWA3S", ""):
        assert spell_name(name) is None


def test_reads_the_layout(grid):
    found = discover(grid)
    assert found.kind == "GRID corpus"
    assert [item.name for item in found.recordings] == ["brwa3s", "lgazzp", "swiz9n"]
    first, second, _ = found.recordings
    assert first.words == ("bin", "red")  # what was said, not what the name spells
    assert second.words == ("lay", "green", "at", "z", "zero", "please")
    assert first.file == grid / "clips" / "brwa3s.mkv"
    assert {item.split for item in found.recordings} == {"train"}
    assert first.rights["attribution"].startswith("GRID corpus (Cooke, Barker, Cunningham, Shao 2006)")
    assert found.problems == {}


def test_bad_word_times_are_reported_and_the_rest_is_read(grid):
    (grid / "align" / "swiz9n.align").write_text("0 100 set\n100 two white\n")
    (grid / "align" / "lgazzp.align").write_text("0 74500 sil\n")
    found = discover(grid)
    assert [item.name for item in found.recordings] == ["brwa3s"]
    assert "line 2 is '100 two white'; required: start end word" in found.problems["swiz9n"]
    assert "holds no word" in found.problems["lgazzp"]


def test_speakers_by_their_folders(tmp_path):
    known = {"s1": "s1", "grid-s1": "s1", "GRID_S23": "s23", "bikes1": "", "s100": "", "s0": "", "clips": ""}
    for folder, speaker in known.items():
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "brwa3s.mpg").touch()
        (item,) = discover(tmp_path / folder).recordings
        assert item.speaker == speaker


def test_hostile_word_times_are_refused(tmp_path):
    file = tmp_path / "a.align"
    for text, message in (
        ("0 1 bin\n" * 9000, "72000 bytes, required at most 65536: are they the words of one sentence"),
        ("0 1 bin\n1 2 \0\n", r"line 2 has '\\x00' where its word should be"),
        ("0 1 7", "line 1 has '7' where its word should be"),
        ("0 1 =cmd|x", r"line 1 has '=cmd\|x' where its word should be"),
        ("0 x" + "1" * 9000 + " bin", r"line 1 is '0 x1{77}\.\.\.'; required: start end word"),
        ("", "holds no word"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=message):
            read_aligned_words(file)
    file.write_text("0 1 Näh\n1 2 o'clock\n2 3 well-known\n3 4 真\n", encoding="utf-8")
    assert read_aligned_words(file) == ("näh", "o'clock", "well-known", "真")


SECOND = "0 1000 sil\n1000 2000 bin\n2000 3000 green\n"
GRID_VIDEOS = {
    "as on Zenodo": ("{}/bbaf2n.mpg", "alignments/{}/bbaf2n.align"),
    "as in Sheffield": ("{}/video/mpg_6000/bbaf2n.mpg", "{}/align/bbaf2n.align"),
    "one folder of word times": ("{}/clips/bbaf2n.mkv", "align/{}/bbaf2n.align"),
    "side by side": ("grid-{}/bbaf2n.mpg", "grid-{}/bbaf2n.align"),
}


@pytest.mark.parametrize("lies", GRID_VIDEOS)
def test_grid_of_all_speakers(tmp_path: Path, lies: str) -> None:
    video, times = GRID_VIDEOS[lies]
    speakers = [f"s{number}" for number in range(1, 35) if number != 21]
    touch(tmp_path, *(video.format(speaker) for speaker in speakers))
    touch(tmp_path, video.format("s2").replace("bbaf2n", "swiz9n"))
    (tmp_path / times.format("s2")).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / times.format("s2")).write_text(SECOND)
    (tmp_path / "test.txt").write_text("s34/bbaf2n\n")
    found = discover(tmp_path)
    assert (found.kind, found.problems) == ("GRID corpus", {})
    assert sorted({each.speaker for each in found.recordings}) == sorted(speakers)
    by_name = {each.name: each for each in found.recordings}
    assert len(by_name) == 34
    assert by_name["s1-bbaf2n"].words == ("bin", "blue", "at", "f", "two", "now")
    assert by_name["s2-bbaf2n"].words == ("bin", "green")
    assert by_name["s2-swiz9n"].words == ("set", "white", "in", "z", "nine", "now")
    assert [each.name for each in found.recordings if each.split == "test"] == ["s34-bbaf2n"]
    assert by_name["s1-bbaf2n"].rights["licence"] == "CC BY 4.0"


LAYOUTS = json.loads(Path(__file__).with_name("layouts.json").read_text("utf-8"))
"""Files of corpora that are known by their folders, and what is read there, or in a folder within."""


@pytest.mark.parametrize("corpus", LAYOUTS)
def test_known_corpora(tmp_path: Path, corpus: str) -> None:
    layout = LAYOUTS[corpus]
    touch(tmp_path, *layout["files"])
    for name, text in layout["texts"].items():
        (tmp_path / name).write_text(text)
    for folder, recordings in layout["within"].items():
        found = discover(tmp_path / folder)
        assert found.problems == {}
        read = [(each.name, each.speaker, " ".join(each.words or ()) or None, each.split) for each in found.recordings]
        assert read == [*map(tuple, recordings)]
        assert layout["rights"] in found.recordings[0].rights.get("attribution", "")


NAMES = np.array(["jaw", "smile", "brow"])
CHANNELS = tuple(Channel(name, "weight") for name in NAMES.tolist())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.save(tmp_path / "anna_bs_name.npy", NAMES)
    for name in ("one", "two"):
        (tmp_path / f"{name}.wav").touch()
        np.save(tmp_path / f"bs_value_{name}.npy", np.random.default_rng(0).uniform(size=(60, 3)))
    return tmp_path


def test_sounds_with_arrays(folder):
    (folder / "one.txt").write_text("Hello.")
    (folder / "LICENSE").write_text("\nThe MIT License\n\nCopyright (c) Anna\nmore\n")
    (folder / "test.txt").write_text("two\n")
    found = discover(folder)
    assert found.kind == "FACEGOOD blendshape weights"
    read = [(item.name, item.split, item.words) for item in found.recordings]
    assert read == [("one", "train", ("hello",)), ("two", "test", None)]
    one = found.recordings[0]
    assert one.file == folder / "one.wav"
    assert one.motion_file == MotionFile(folder / "bs_value_one.npy", 30.0, CHANNELS)
    assert one.rights == {"licence": "The MIT License", "attribution": "Copyright (c) Anna"}
    motion = read_bare_motion(one.motion_file)
    assert (motion.rate_hz, motion.channels) == (30.0, CHANNELS)
    np.testing.assert_array_equal(motion.values, np.load(folder / "bs_value_one.npy"))
    (folder / "LICENSE").write_text("MIT License\n" + "x" * 20_000 + "\nCopyright (c) nobody\n")
    assert discover(folder).recordings[0].rights == {"licence": "MIT License"}  # of which the beginning is read


def test_an_array_needs_one_sound(folder):
    (folder / "one.wav").rename(folder / "three.wav")
    (folder / "two.flac").touch()
    found = discover(folder)
    assert found.recordings == ()
    assert "0 sounds named one, required one: one.wav" in found.problems["one"]
    assert "2 sounds named two" in found.problems["two"]


def test_a_header_written_by_python_2(folder, recwarn):
    """Its sizes end in L."""
    path = folder / "bs_value_one.npy"
    plain = path.read_bytes()
    old = plain.replace(b"(60, 3)", b"(60L, 3L)").replace(b"  \n", b"\n", 1)
    assert len(old) == len(plain)
    path.write_bytes(old)
    assert read_bare_motion(MotionFile(path, 30.0, CHANNELS)).values.shape == (60, 3)
    assert not recwarn.list


class Harmful:
    """Removes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return Path.unlink, (self.path,)


@pytest.mark.parametrize("name", ["anna_bs_name.npy", "bs_value_one.npy"])
def test_nothing_is_unpickled(folder, name):
    victim = folder / "victim"
    victim.touch()
    np.save(folder / name, np.array([Harmful(victim)], object), allow_pickle=True)
    with pytest.raises(InputError, match=r"not an array of numbers or texts .*save it with numpy\.save"):
        read_channels(folder / name) if "name" in name else read_bare_motion(MotionFile(folder / name, 30.0, CHANNELS))
    assert victim.exists()


def test_names_that_are_none(folder):
    twice, text = (np.arange(3.0), np.array(["a", "a", "b"])), "required one row of different texts"
    formulas = (np.array([name, "b", "c"]) for name in ("=1+1", "@SUM(A1)", "\t=1"))
    wrong = [(names, text) for names in twice] + [(names, "begins as a spreadsheet's formula") for names in formulas]
    for names, message in wrong:
        np.save(folder / "anna_bs_name.npy", names)
        with pytest.raises(InputError, match=message):
            discover(folder)
    np.save(folder / "ben_bs_name.npy", NAMES)
    with pytest.raises(InputError, match="2 lists of channel names"):
        discover(folder)


def test_arrays_that_do_not_fit(folder):
    wanted = r"required numbers of shape \(frames, 3\)"
    for values, message in (
        (np.zeros((5, 2)), wanted),
        (np.array([["a", "b", "c"]]), wanted),
        (np.zeros((2, 3), bool), wanted),
        (np.full((5, 3), np.nan), "not finite"),
    ):
        np.save(folder / "bs_value_one.npy", values)
        with pytest.raises(InputError, match=message):
            read_bare_motion(MotionFile(folder / "bs_value_one.npy", 30.0, CHANNELS))


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    for name in ("a.wav", "a.csv", "a.recorder.flac", "b.mp4", "b.recorder.wav", "b.recorder.mp3", "anna/c.mov"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def test_a_recorder_belongs_to_its_recording(studio):
    (studio / "offsets.csv").write_text("name,offset_ms\nanna/c, -12.5\n\ngone,3\n")
    found = add_separate_sounds(discover(studio), studio, 0.1)
    first, second = ((item.name, item.recorder, item.offset_s) for item in found.recordings)
    assert (first, second) == (("a", studio / "a.recorder.flac", 0.1), ("anna-c", None, -0.0125))
    assert "2 recorders' sounds beside it: b.recorder.mp3, b.recorder.wav; keep one" in found.problems["b"]
    assert found.problems["gone"] == "in offsets.csv, but there is no such recording"
    (studio / "offsets.csv").write_text("name,offset_ms\na,7\nothers,3\n")
    found = add_separate_sounds(discover(studio), studio, is_whole=False)  # one video of many has its own row
    assert found.recordings[0].offset_s == pytest.approx(0.007)
    assert "others" not in found.problems


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
