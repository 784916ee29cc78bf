import gzip
import io
import os
import zipfile
from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.sources import Source, check_apart, check_kind


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


def test_what_a_folder_links_to_belongs_to_it_and_a_link_into_it_leads_there(place: Path) -> None:
    corpus = [Source(place / "folder", "corpus")]
    (place / "elsewhere.wav").write_text("sound")
    check_apart([place / "elsewhere.wav"], corpus)
    (place / "folder" / "b.wav").symlink_to(place / "elsewhere.wav")
    with pytest.raises(ExportError, match=r"elsewhere\.wav: belongs to the corpus"):
        check_apart([place / "elsewhere.wav"], corpus)
    (place / "shortcut").symlink_to(place / "folder" / "deep")
    with pytest.raises(ExportError, match=r"lies in the corpus .*folder"):
        check_apart([place / "shortcut" / "new.json"], corpus)


def test_a_folder_that_is_written_holds_nothing_that_is_read(place: Path) -> None:
    for source in ("folder/deep", "folder/deep/a.wav"):
        with pytest.raises(ExportError, match="folder: holds the recording"):
            check_apart([], [Source(place / source, "recording")], folders=[place / "folder"])
    check_apart([place / "folder"], [Source(place / "folder" / "deep", "recording")])


def test_what_has_nothing_to_do_with_each_other(place: Path) -> None:
    sources = [Source(place / name, "text") for name in ("words.txt", "folder", "none", "x" * 5000, "a\0b")]
    check_apart([place / "new.json", place / "folder2", place / ("y" * 5000)], sources, folders=[place / "new"])


def packed(*names: str, kind: str = "") -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as file:
        for name, text in [("mimetype", kind)][not kind :] + [(name, "x" * 9000) for name in names]:
            file.writestr(name, text)
    return content.getvalue()


OLD_OFFICE = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(600)
FILES = {
    "a Word document": packed("[Content_Types].xml", "word/document.xml"),
    "old Office": OLD_OFFICE,
    "OpenDocument": packed("content.xml", kind="application/vnd.oasis.opendocument.text"),
    "Excel": packed("xl/workbook.xml"),
    "PDF": b"%PDF-1.7\n%\xe2\xe3",
    "RTF": b"{\\rtf1\\ansi",
    "Blender": b"BLENDER-v402REND",
    "a Blender file": gzip.compress(b"BLENDER_v279" + bytes(600)),
    "compressed": bytes.fromhex("28b52ffd0458"),
    "FBX": b"Kaydara FBX Binary  \0\x1a\0",
    "Maya": b"//Maya ASCII 2024 scene\n",
    "Photoshop": b"8BPS\0\x01",
    "Ableton": gzip.compress(b'<?xml version="1.0" encoding="UTF-8"?>\n<Ableton MajorVersion="5">' + bytes(9000)),
    "Audacity": b"SQLite format 3\0" + bytes(52) + b"AUDY" + bytes(28),
    "Reaper": b'<REAPER_PROJECT 0.1 "7.0"\n',
    "MIDI": b"MThd\0\0\0\x06",
    "web page": b"<!DOCTYPE html>\n<html>",
    "Git LFS": b"version https://git-lfs.github.com/spec/v1\n",
}
ELSEWHERE = {"a picture": b"\x89PNG\r\n\x1a\n", "archive": packed("take.wav"), "7z": b"7z\xbc\xaf\x27\x1c\0"}


@pytest.mark.parametrize("wanted", ["recording", "text", "motion file", "character"])
@pytest.mark.parametrize("name", FILES)
def test_it_is_named(name: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "take.wav"
    path.write_bytes(FILES[name])
    with pytest.raises(InputError, match=rf"take\.wav: is an? .*, required a {wanted}; ") as told:
        check_kind(path, wanted)
    assert name in str(told.value)


@pytest.mark.parametrize("wanted", ["recording", "text"])
def test_what_is_no_mistake_elsewhere(wanted: str, tmp_path: Path) -> None:
    for name, content in ELSEWHERE.items():
        (tmp_path / "take").write_bytes(content)
        with pytest.raises(InputError, match=f"required a {wanted}"):
            check_kind(tmp_path / "take", wanted)
        if name != "7z":
            check_kind(tmp_path / "take", "face")


def test_what_is_wanted_passes(tmp_path: Path) -> None:
    for wanted, content in (
        ("recording", b"RIFF\0\0\0\0WAVEfmt "),
        ("text", b"BLENDERS are loud. The blender of Maya is a PDF."),
        ("motion file", packed("values.npy")),
        ("character", b"glTF\2\0\0\0"),
        ("recording", b""),
    ):
        (tmp_path / "take").write_bytes(content)
        check_kind(tmp_path / "take", wanted)
    check_kind(tmp_path, "recording")
    check_kind(tmp_path / "missing", "recording")
    (tmp_path / "take").write_bytes(b"RIFF\0\0\0\0WAVEfmt ")
    for wanted in ("text", "motion file"):
        with pytest.raises(InputError, match="is a recording"):
            check_kind(tmp_path / "take", wanted)
