"""Files that are given in the place of others are named by their content, whatever their suffix."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.storage.sources import check_kind


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
