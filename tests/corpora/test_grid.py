from pathlib import Path

import pytest

from lipmotion.corpora.folder import discover, read_aligned_words, read_grid, spell_name
from lipmotion.errors import InputError


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


def test_videos_and_times_directly_in_the_folder(tmp_path):
    for name in ("brbk7n.mpg", "swwp2s.mpg"):
        (tmp_path / name).touch()
    (tmp_path / "swwp2s.align").write_text("0 9000 sil\n9000 20000 set\n")
    found = discover(tmp_path)
    assert found.kind == "GRID corpus"
    assert found.recordings[1].words == ("set",)


def test_bad_word_times_are_reported_and_the_rest_is_read(grid):
    (grid / "align" / "swiz9n.align").write_text("0 100 set\n100 two white\n")
    (grid / "align" / "lgazzp.align").write_text("0 74500 sil\n")
    found = discover(grid)
    assert [item.name for item in found.recordings] == ["brwa3s"]
    assert "line 2 is '100 two white'; required: start end word" in found.problems["swiz9n"]
    assert "holds no word" in found.problems["lgazzp"]


def test_other_videos_are_not_grid(tmp_path):
    (tmp_path / "holiday.mp4").touch()
    assert read_grid(tmp_path) is None
    assert discover(tmp_path).kind == "folder of videos"


@pytest.mark.recordings
def test_the_real_thing():
    folder = Path(__file__).parents[2].parent / "shared" / "corpora" / "grid-s1"
    if not folder.is_dir():
        pytest.skip("the real recordings are not here")
    found = discover(folder)
    assert found.kind == "GRID corpus"
    assert found.problems == {}
    splits = [item.split for item in found.recordings]
    assert {split: splits.count(split) for split in splits} == {"train": 452, "val": 22, "test": 50}
    assert sum(item.words == spell_name(item.name) for item in found.recordings) >= 520
    assert all(item.words is not None and len(item.words) == 6 for item in found.recordings)


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
