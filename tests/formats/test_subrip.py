"""SubRip: the form of its files, and read back as a transcript."""

from __future__ import annotations

from pathlib import Path

from lipmotion.formats.label_files import read_labels, write_labels
from lipmotion.types import Span, Timeline, Unit

ROWS = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 3599.9996, "dh", "there")]
UNITS = Timeline(tuple(Span(start, end, Unit(phone, "", word)) for start, end, phone, word in ROWS))


def test_words_and_phones(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.srt", UNITS)
    assert (tmp_path / "a.srt").read_text(encoding="utf-8") == (
        "1\n00:00:00,310 --> 00:00:00,520\nma\n\n2\n00:00:00,520 --> 01:00:00,000\nthere\n\n"
    )
    write_labels(tmp_path / "a.phones.SRT", UNITS)
    assert (tmp_path / "a.phones.SRT").read_text(encoding="utf-8").splitlines()[2::4] == ["m", "aa", "dh"]


def test_words_come_back_as_a_transcript(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.srt", UNITS)
    transcript = read_labels(tmp_path / "a.srt").transcript
    assert transcript is not None
    assert [(line.start_s, line.end_s) for line in transcript.lines] == [(0.31, 0.52), (0.52, 3600.0)]
    assert transcript.words == ("ma", "there")


def test_silence_alone_is_an_empty_file(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.srt", Timeline((Span(0.0, 1.0, Unit("sil")),)))
    assert (tmp_path / "a.srt").read_bytes() == b""
