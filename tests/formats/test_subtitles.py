import html
from pathlib import Path

import pytest

from lipmotion.formats.label_files import read_labels, write_labels
from lipmotion.types import Span, Timeline, Unit

ROWS = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 3599.9996, "dh", "r&d <the>")]
UNITS = Timeline(tuple(Span(start, end, Unit(phone, "", word)) for start, end, phone, word in ROWS))
FIRST, SECOND, THIRD = "00:00:00.310 --> 00:00:00.520", "00:00:00.520 --> 01:00:00.000", "00:00:00.310 --> 00:00:00.400"
WEBVTT = f"WEBVTT\n\n{FIRST}\nma\n\n{SECOND}\nr&amp;d &lt;the&gt;\n"
WEBVTT_PHONES = f"WEBVTT\n\n{THIRD}\nm\n\n00:00:00.400 --> 00:00:00.520\naa\n\n{SECOND}\ndh\n"


def as_subrip(webvtt: str) -> str:
    """Return cues with numbers, and commas in their times."""
    cues = webvtt.replace(".", ",").rstrip().split("\n\n")[1:]
    return "".join(f"{number}\n{cue}\n\n" for number, cue in enumerate(cues, 1))


@pytest.mark.parametrize("suffix", [".srt", ".vtt"])
def test_words_and_phones_are_written_and_words_come_back(tmp_path: Path, suffix: str) -> None:
    def text(units: Timeline[Unit], name: str) -> str:
        write_labels(tmp_path / name, units)
        return (tmp_path / name).read_text(encoding="utf-8")

    words, phones = WEBVTT, WEBVTT_PHONES
    if suffix == ".srt":
        words, phones = as_subrip(html.unescape(words)), as_subrip(phones)
    assert text(UNITS, f"a{suffix}") == words
    assert text(UNITS, f"a.phones{suffix.upper()}") == phones
    plain = Timeline((*UNITS.spans[:3], Span(0.52, 3599.9996, Unit("dh", "", "there"))))
    text(plain, f"a{suffix}")
    transcript = read_labels(tmp_path / f"a{suffix}").transcript
    assert [(line.start_s, line.end_s) for line in transcript.lines] == [(0.31, 0.52), (0.52, 3600.0)]
    assert transcript.words == ("ma", "there")
    silence = text(Timeline((Span(0.0, 1.0, Unit("sil")),)), f"b{suffix}")
    assert silence.strip() == ("WEBVTT" if suffix == ".vtt" else "")


def test_others_read_it(tmp_path: Path) -> None:
    """Oracle: webvtt-py."""
    webvtt = pytest.importorskip("webvtt")
    write_labels(tmp_path / "a.vtt", UNITS)
    found = [(cue.start, cue.end, cue.text) for cue in webvtt.read(str(tmp_path / "a.vtt"))]
    assert found[0] == ("00:00:00.310", "00:00:00.520", "ma")
    assert found[1][:2] == ("00:00:00.520", "01:00:00.000")


def test_a_word_that_is_said_twice_is_written_twice_whatever_the_capitals_of_the_suffix(tmp_path: Path) -> None:
    big = tuple(Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split()))
    for name, start, said in (("a.vtt", "WEBVTT", "big"), ("a.TEXTGRID", "File type", '"big"')):
        write_labels(tmp_path / name, Timeline(big))
        text = (tmp_path / name).read_text()
        assert text.startswith(start)
        assert text.count(said) == 2
