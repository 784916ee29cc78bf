from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import CorpusError, InputError
from lipmotion.types import Channel
from lipmotion_faces.corpus.captured_faces import read_bare_motion, read_channels
from lipmotion_faces.corpus.folder import discover, read_aligned_words, spell_name
from lipmotion_faces.corpus.source_recordings import MotionFile, RecordingFolder, add_separate_sounds, read_offsets


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_videos_of_any_kind_are_found_and_those_of_one_name_reported(tmp_path):
    touch(tmp_path, "b.MP4", "a.mov", "day 1/c.webm", "notes.pdf", "speech.wav", ".cache/d.mp4", ".part-e.mkv")
    found = discover(tmp_path)
    assert found.kind == "folder of videos"
    assert [item.name for item in found.recordings] == ["a", "b", "day 1-c"]
    assert [item.words for item in found.recordings] == [None, None, None]
    assert {item.split for item in found.recordings} == {"train"}
    touch(tmp_path, "same/a.mp4", "same/a.mkv", "same/b.mp4", "same/anna/a.mp4", "same/anna-a.mp4")
    found = discover(tmp_path / "same")
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


def read(folder: Path) -> list[tuple[str, str, str | None]]:
    """Return name, speaker and words of the recordings in a folder that has no problems."""
    found: RecordingFolder = discover(folder)
    assert found.problems == {}
    return [(each.name, each.speaker, " ".join(each.words) if each.words else None) for each in found.recordings]


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


def test_crema_d_says_its_sentences_in_its_names(tmp_path: Path) -> None:
    names = "1001_DFA_ANG_XX", "1001_IEO_HAP_LO", "1091_WSI_SAD_X"
    touch(tmp_path, *(f"VideoFlash/{name}.flv" for name in names), *(f"AudioWAV/{name}.wav" for name in names))
    said = [
        ("1001_DFA_ANG_XX", "1001", "don't forget a jacket"),
        ("1001_IEO_HAP_LO", "1001", "it's eleven o'clock"),
        ("1091_WSI_SAD_X", "1091", "we'll stop in a couple of minutes"),
    ]
    assert read(tmp_path) == read(tmp_path / "VideoFlash") == said
    assert discover(tmp_path).kind == "CREMA-D"


def test_tcd_timit_from_the_front_with_its_scripts(tmp_path: Path) -> None:
    clips = "volunteers/01M/Clips/straightcam", "volunteers/02F/straightcam", "lipspeakers/Lipspkr1/Clips/straightcam"
    touch(tmp_path, *(f"{folder}/sa1.mp4" for folder in clips), "volunteers/01M/Clips/30degcam/sa1.mp4")
    (tmp_path / clips[0] / "SA1.txt").write_text("0 8000 sil\n8000 9100 She\n9100 9900 had,\n9900 12000 YOUR\n")
    (tmp_path / clips[1] / "sa1.txt").write_text("She had your dark suit.\n")
    assert read(tmp_path) == [
        ("01M-sa1", "01M", "she had your"),
        ("02F-sa1", "02F", "she had your dark suit"),
        ("Lipspkr1-sa1", "Lipspkr1", None),
    ]
    assert read(tmp_path / "volunteers" / "01M") == [("01M-sa1", "01M", "she had your")]
    assert "Harte" in discover(tmp_path).recordings[0].rights["attribution"]


def test_mead_from_the_front(tmp_path: Path) -> None:
    views = "front", "down", "left_30", "left_60", "right_30", "right_60", "top"
    touch(tmp_path, *(f"M003/video/{view}/happy/level_1/001.mp4" for view in views))
    touch(tmp_path, "W009/video/front/sad/level_2/001.mp4", "M003/audio/happy/level_1/001.m4a")
    (tmp_path / "M003/video/front/happy/level_1/001.txt").write_text("Hello there.")
    assert read(tmp_path) == [("M003-happy-level_1-001", "M003", "hello there"), ("W009-sad-level_2-001", "W009", None)]


LRS2 = "Text:  WHEN YOU'RE COOKING\nConf:  4\n\nWORD START END ASDSCORE\nWHEN 0.10 0.20 7.1\nYOU'RE 0.2 0.5 8\n"


def test_lrs_texts_lists_and_sets(tmp_path: Path) -> None:
    touch(tmp_path, "main/635/00001.mp4", "main/635/00002.mp4", "main/77/00001.mp4", "pretrain/77/00001.mp4")
    (tmp_path / "main/635/00001.txt").write_text("Text:  IT'S {LG} TWENTY PAST\nConf:  4\n")
    (tmp_path / "main/77/00001.txt").write_text("Text:  HELLO\n")
    (tmp_path / "pretrain/77/00001.txt").write_text(LRS2)
    (tmp_path / "val.txt").write_text("635/00002\n")
    (tmp_path / "test.txt").write_text("77/00001 NF MV\n")
    assert read(tmp_path) == [
        ("635-00001", "635", "it's twenty past"),
        ("635-00002", "635", None),
        ("77-00001", "77", "hello"),
        ("pretrain-77-00001", "77", "when you're"),
    ]
    assert [each.split for each in discover(tmp_path).recordings] == ["train", "val", "test", "train"]
    assert [name for name, *_ in read(tmp_path / "main")] == ["635-00001", "635-00002", "77-00001"]


def test_the_test_folder_of_lrs3_is_the_test_list(tmp_path: Path) -> None:
    touch(tmp_path, "trainval/0Amg53UuRqE/50001.mp4", "test/0Fi83BHQsMA/00002.mp4")
    found = {each.name: each.split for each in discover(tmp_path).recordings}
    assert found == {"0Amg53UuRqE-50001": "train", "0Fi83BHQsMA-00002": "test"}


def test_other_folders_are_read_as_before(tmp_path: Path) -> None:
    touch(tmp_path, "main/anna/hello.mp4", "1001_DFA_ANG_XX.mp4", "s1/day.mp4", "ben/straightcam.mp4")
    found = discover(tmp_path)
    assert found.kind == "folder of videos"
    assert [each.speaker for each in found.recordings] == ["", "ben", "main", "s1"]


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


def test_what_is_wrong_with_a_table_is_said_but_not_a_spreadsheets_own_marks(tmp_path):
    (tmp_path / "offsets.csv").write_text("sep=;\nname;offset_ms;\nanna/c;-12,5\n;\n", encoding="utf-8-sig")
    assert read_offsets(tmp_path / "offsets.csv") == {"anna-c": pytest.approx(-0.0125)}
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
