from __future__ import annotations

import os
from pathlib import Path

import pytest

from lipmotion.errors import ExportError
from lipmotion.storage.sources import Source, check_apart


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A text, and a folder with a recording in it."""
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "folder" / "deep").mkdir(parents=True)
    (tmp_path / "folder" / "deep" / "a.wav").write_text("sound")
    return tmp_path


def test_a_file_is_known_whatever_its_name(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = place / "words.txt"
    (place / "soft").symlink_to(words)
    os.link(words, place / "hard")
    monkeypatch.chdir(place / "folder")
    for name in (words, place / "soft", place / "hard", Path("../words.txt"), Path("deep/../../folder/../words.txt")):
        for target, source in ((name, words), (words, name)):
            with pytest.raises(ExportError, match=r": is the transcript itself; give another name$"):
                check_apart([target], [Source(source, "transcript")])
            with pytest.raises(ExportError, match=r"give another name, or add --force to replace it$"):
                check_apart([target], [Source(source, "transcript", replaceable=True)])
            check_apart([target], [Source(source, "transcript", replaceable=True)], force=True)
            with pytest.raises(ExportError, match="is the transcript itself"):
                check_apart([target], [Source(source, "transcript")], force=True)


def test_nothing_is_written_into_a_folder_that_is_read(place: Path) -> None:
    folder = Source(place / "folder", "corpus", replaceable=True)
    (place / "way in").symlink_to(place / "folder")
    for name in ("folder/new.json", "folder/deep/a.wav", "folder/deep/new", "way in/new.json"):
        for force in (False, True):
            with pytest.raises(ExportError, match=r": lies in the corpus .*folder; give another name$"):
                check_apart([place / name], [folder], force=force)
            with pytest.raises(ExportError, match="lies in the corpus"):
                check_apart([], [folder], folders=[place / name], force=force)


def test_what_a_folder_links_to_belongs_to_it(place: Path) -> None:
    (place / "elsewhere.wav").write_text("sound")
    check_apart([place / "elsewhere.wav"], [Source(place / "folder", "corpus")])
    (place / "folder" / "b.wav").symlink_to(place / "elsewhere.wav")
    with pytest.raises(ExportError, match=r"elsewhere\.wav: belongs to the corpus"):
        check_apart([place / "elsewhere.wav"], [Source(place / "folder", "corpus")])


def test_a_folder_that_is_written_holds_nothing_that_is_read(place: Path) -> None:
    for source in ("folder/deep", "folder/deep/a.wav"):
        with pytest.raises(ExportError, match="folder: holds the recording"):
            check_apart([], [Source(place / source, "recording")], folders=[place / "folder"])
    check_apart([place / "folder"], [Source(place / "folder" / "deep", "recording")])


def test_what_has_nothing_to_do_with_each_other(place: Path) -> None:
    sources = [Source(place / name, "text") for name in ("words.txt", "folder", "none", "x" * 5000, "a\0b")]
    check_apart([place / "new.json", place / "folder2", place / ("y" * 5000)], sources, folders=[place / "new"])


def test_a_link_to_a_folder_inside_a_corpus_leads_into_the_corpus(place: Path) -> None:
    (place / "shortcut").symlink_to(place / "folder" / "deep")
    with pytest.raises(ExportError, match=r"lies in the corpus .*folder"):
        check_apart([place / "shortcut" / "new.json"], [Source(place / "folder", "corpus")])
