from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.formats.label_files import check_plain_text, read_labels

OTHER = {
    "master labels": ('#!MLF!#\n"*/a.lab"\n0 1000000 sil\n.\n', "is a master label file"),
    "RTF": ("{\\rtf1\\ansi hello}", "begins with '{|rich-text"),
    "HTML": ("\n<html><body>hello</body></html>", "begins with '<html>|web page"),
    "ESPS with a header": ("signal b\nnfields 1\n#\n 0.0500 26 sil\n 0.1 26 p\n 0.2 26 aa\n", "its lines hold times"),
    "NUL": ("hello you\0 there", "holds NUL characters"),
    "ESPS": ("signal a\nnfields 1\n#\n 0.0500 26 sil\n 0.1 26 p\n 0.2 26 aa\n", "its lines hold times"),
    "mixed seconds": ("0 0.5 p\n0.5 1 aa\n", "its lines hold times"),
    "a start of NaN": ("nan 1000000 sil\n1000000 2000000 p\n2000000 3500000 aa\n", "its lines hold times"),
    "a last start of 0": ("0 sil\n1000000 p\n0 aa\n", "its lines hold times"),
}
TIMED = {
    "SubRip": ("1\n00:00:01,000 --> 00:00:02,000\nhello\n", "is a file of subtitles"),
    "WebVTT": ("WEBVTT\n\n00:01.000 --> 00:02.000\nhello\n", "is a file of subtitles"),
    "JSON": ('{"words": [{"start": 0.0, "word": "hello"}]}', "begins with '{|rich-text"),
    "CTM": ("a 1 0.00 0.5 hello\na 1 0.5 0.5 you\n", "labels in time"),
}
"""What is read as a transcript, but is no plain text."""
WORDS = [
    "hello you",
    "3 5 7\n1 2 9\n",
    "20 30 people\n40 50 more\n",
    "Chapter 1\n\n1.5 million people came.\nThey stayed.\n",
    "It took 1234567 steps,\n3.5 days.\n",
    "a --> b",
    "# a heading\n\nhello\n",
    "<3 you",
    "[laughs] hello",
]


def test_what_would_be_read_as_words_is_refused(tmp_path: Path) -> None:
    for text, message in OTHER.values():
        for suffix in (".txt", ".lab"):
            path = tmp_path / f"a{suffix}"
            path.write_text(text, encoding="utf-8")
            with pytest.raises(InputError, match=message):
                read_labels(path)
        with pytest.raises(InputError, match=message):
            check_plain_text(text, "a.txt")


def test_words_in_time_are_no_plain_text(tmp_path: Path) -> None:
    for text, message in TIMED.values():
        with pytest.raises(InputError, match=message):
            check_plain_text(text, "a.txt")
        (tmp_path / "a.txt").write_text(text, encoding="utf-8")
        assert "hello" in (read_labels(tmp_path / "a.txt").words or ())


def test_words_with_numbers_are_words(tmp_path: Path) -> None:
    for text in WORDS:
        check_plain_text(text, "a.txt")
        (tmp_path / "a.txt").write_text(text, encoding="utf-8")
        assert read_labels(tmp_path / "a.txt").words


def test_labels_in_time_are_no_plain_text() -> None:
    for text in ("0 1000000 p\n1000000 2000000 aa\n", "0.0\t0.5\thello\n", '"ooTextFile" "TextGrid"'):
        with pytest.raises(InputError, match=r"a\.txt: holds labels in time, required the words alone"):
            check_plain_text(text, "a.txt")
