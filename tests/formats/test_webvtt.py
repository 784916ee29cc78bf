"""WebVTT: read back as a transcript, and by others."""

from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.formats.label_files import read_labels, write_labels
from lipmotion.formats.subtitles import write_webvtt
from lipmotion.formats.textgrid import write_textgrid
from lipmotion.types import Span, Timeline, Unit

ROWS = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 3599.9996, "dh", "r&d <the>")]
UNITS = Timeline(tuple(Span(start, end, Unit(phone, "", word)) for start, end, phone, word in ROWS))


def test_words_and_phones(tmp_path: Path) -> None:
    write_webvtt(tmp_path / "a.vtt", UNITS)
    assert (tmp_path / "a.vtt").read_text(encoding="utf-8") == (
        "WEBVTT\n\n00:00:00.310 --> 00:00:00.520\nma\n\n00:00:00.520 --> 01:00:00.000\nr&amp;d &lt;the&gt;\n"
    )
    write_labels(tmp_path / "a.phones.VTT", UNITS)
    lines = (tmp_path / "a.phones.VTT").read_text(encoding="utf-8").splitlines()
    assert lines[2:] == [
        *("00:00:00.310 --> 00:00:00.400", "m", ""),
        *("00:00:00.400 --> 00:00:00.520", "aa", ""),
        *("00:00:00.520 --> 01:00:00.000", "dh"),
    ]


def test_words_come_back_as_a_transcript(tmp_path: Path) -> None:
    units = Timeline(
        tuple(Span(n / 2, n / 2 + 0.4, Unit("m", "", word)) for n, word in enumerate("please speak".split()))
    )
    write_webvtt(tmp_path / "a.vtt", units)
    transcript = read_labels(tmp_path / "a.vtt").transcript
    assert transcript is not None
    assert transcript.words == ("please", "speak")
    assert [(line.start_s, line.end_s) for line in transcript.lines] == [(0.0, 0.4), (0.5, 0.9)]


def test_others_read_it(tmp_path: Path) -> None:
    """Oracle: webvtt-py."""
    webvtt = pytest.importorskip("webvtt")
    write_webvtt(tmp_path / "a.vtt", UNITS)
    found = [(cue.start, cue.end, cue.text) for cue in webvtt.read(str(tmp_path / "a.vtt"))]
    assert found[0] == ("00:00:00.310", "00:00:00.520", "ma")
    assert found[1][:2] == ("00:00:00.520", "01:00:00.000")


def test_capitals_of_a_suffix_do_not_matter(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.TEXTGRID", UNITS)
    assert (tmp_path / "a.TEXTGRID").read_text().startswith("File type")


def test_a_word_that_is_said_twice_is_written_twice(tmp_path: Path) -> None:
    big = tuple(Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split()))
    write_webvtt(tmp_path / "a.vtt", Timeline(big))
    assert (tmp_path / "a.vtt").read_text().count("big") == 2
    write_textgrid(tmp_path / "a.TextGrid", Timeline(big))
    assert (tmp_path / "a.TextGrid").read_text().count('"big"') == 2
