from pathlib import Path

import pytest

from corpora.test_folder import touch
from lipmotion.corpora.folder import discover
from lipmotion.corpora.source_recordings import RecordingFolder


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
    touch(
        tmp_path,
        *(f"M003/video/{view}/happy/level_1/001.mp4" for view in views),
        "W009/video/front/sad/level_2/001.mp4",
    )
    touch(tmp_path, "M003/audio/happy/level_1/001.m4a")
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


def test_one_name_twice_is_left_out(tmp_path: Path) -> None:
    touch(tmp_path, "s1/mpg_vcd/bbaf2n.mpg", "s1/mpg_6000/bbaf2n.mpg", "s2/mpg_vcd/bbaf2n.mpg")
    found = discover(tmp_path)
    assert [each.name for each in found.recordings] == ["s2-bbaf2n"]
    assert "2 recordings share this name" in found.problems["s1-bbaf2n"]
