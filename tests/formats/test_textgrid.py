from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.formats.label_files import read_labels, read_phones
from lipmotion.formats.textgrid import write_textgrid
from lipmotion.types import Span, Timeline, Unit

WORDS = [(0.0, 0.31, "sil", ""), (0.31, 0.4, "m", "ma"), (0.4, 0.52, "aa", "ma"), (0.52, 0.7, "dh", 'a "the"')]


def test_phones_and_words_are_read_back(tmp_path: Path) -> None:
    units = Timeline(tuple(Span(a, b, Unit(phone, "", word)) for a, b, phone, word in WORDS))
    write_textgrid(tmp_path / "a.TextGrid", units)
    again = read_phones(tmp_path / "a.TextGrid")
    assert [(s.start_s, s.end_s, s.label.phone) for s in again] == [row[:3] for row in WORDS]
    assert read_labels(tmp_path / "a.TextGrid").words == ("ma", "a", "the")


def test_gaps_become_intervals_without_text(tmp_path: Path) -> None:
    units = Timeline((Span(0.1, 0.2, Unit("m")), Span(0.3, 0.4, Unit("aa"))))
    write_textgrid(tmp_path / "a.TextGrid", units)
    again = read_phones(tmp_path / "a.TextGrid")
    assert [s.label.phone for s in again] == ["sil", "m", "sil", "aa"]
    assert [s.end_s for s in again] == [0.1, 0.2, 0.3, 0.4]


def test_times_words_and_confidences_are_exact(tmp_path: Path) -> None:
    edges_s = [0.0, 1 / 3, 0.1 * 5 + 1e-12, 10 / 7]
    labels = [Unit("sil"), Unit("b", word="big", confidence=0.1 + 0.2), Unit("ih", word="big", confidence=1e-7)]
    units = Timeline(tuple(Span(a, b, label) for a, b, label in zip(edges_s, edges_s[1:], labels, strict=False)))
    write_textgrid(tmp_path / "a.TextGrid", units)
    assert read_phones(tmp_path / "a.TextGrid") == units


def test_recognised_phones_are_no_words(tmp_path: Path) -> None:
    write_textgrid(tmp_path / "a.TextGrid", Timeline((Span(0.0, 0.2, Unit("m", confidence=0.0)),)))
    assert "m 0.0" in (tmp_path / "a.TextGrid").read_text(encoding="utf-8")
    assert read_labels(tmp_path / "a.TextGrid").words is None


def test_a_tier_of_that_name_with_something_else_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "a.TextGrid"
    write_textgrid(path, Timeline((Span(0.0, 0.2, Unit("m", confidence=0.5)),)))
    path.write_text(path.read_text(encoding="utf-8").replace("m 0.5", "said by Anna"), encoding="utf-8")
    assert [span.label.confidence for span in read_phones(path)] == [None]


def test_others_read_it(tmp_path: Path) -> None:
    """Oracles: praatio, and Praat itself in parselmouth."""
    textgrid, parselmouth = pytest.importorskip("praatio.textgrid"), pytest.importorskip("parselmouth")
    sure = (None, 0.37, None, None)
    rows = zip(WORDS, sure, strict=True)
    units = Timeline(tuple(Span(a, b, Unit(phone, "", word, each)) for (a, b, phone, word), each in rows))
    write_textgrid(tmp_path / "a.TextGrid", units)
    found = textgrid.openTextgrid(str(tmp_path / "a.TextGrid"), includeEmptyIntervals=True, reportingMode="error")
    assert found.tierNames == ("phones", "words", "recognised")
    assert [entry.label for entry in found.getTier("recognised").entries] == ["", "m 0.37", ""]
    assert [tuple(entry) for entry in found.getTier("phones").entries] == [row[:3] for row in WORDS]
    assert [entry.label for entry in found.getTier("words").entries] == ["", "ma", 'a "the"']
    praat = parselmouth.praat
    grid = parselmouth.read(str(tmp_path / "a.TextGrid"))
    assert praat.call(grid, "Get number of intervals", 1) == len(WORDS)
    assert praat.call(grid, "Get label of interval", 2, 3) == 'a "the"'
