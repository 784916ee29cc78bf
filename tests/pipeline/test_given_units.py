"""Phones in time that users give: motion files, units alone, labels of other programs; gaps are silence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.pipeline.understand.given_units import read_units
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import without_gaps

ROWS = [(0.0, 0.4, "sil"), (0.4, 0.5, "m"), (0.5, 0.7, "aa")]


def timeline(*rows: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start_s, end_s, Unit(phone)) for start_s, end_s, phone in rows))


def phones(units: Timeline[Unit]) -> list[tuple[float, float, str]]:
    return [(round(span.start_s, 6), round(span.end_s, 6), span.label.phone) for span in units]


def test_units_alone_without_names_of_units(tmp_path: Path) -> None:
    rows = [{"start_s": a, "end_s": b, "phone": phone} for a, b, phone in ROWS]
    (tmp_path / "a.json").write_text(json.dumps({"units": rows}), encoding="utf-8")
    assert read_units(tmp_path / "a.json") == timeline(*ROWS)
    (tmp_path / "b.json").write_text('{"units": [{"start_s": 0, "phone": "m"}]}', encoding="utf-8")
    with pytest.raises(
        InputError, match=r"b\.json: a unit has no 'end_s'; export it again, or give start_s, end_s and phone"
    ):
        read_units(tmp_path / "b.json")
    (tmp_path / "c.json").write_text('{"phones": []}', encoding="utf-8")
    with pytest.raises(InputError, match=r"c\.json: not a motion document"):
        read_units(tmp_path / "c.json")


def test_labels_of_audacity_with_a_gap(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0.0\t0.4\tsil\n0.5\t0.7\taa\n", encoding="utf-8")
    assert phones(read_units(tmp_path / "a.txt")) == [ROWS[0], ROWS[2]]
    (tmp_path / "b.txt").write_text("please speak\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"b\.txt: holds no phones in time"):
        read_units(tmp_path / "b.txt")
    with pytest.raises(InputError, match=r"c\.txt: no such units file"):
        read_units(tmp_path / "c.txt")


def test_gaps_are_silence() -> None:
    filled = without_gaps(timeline((0.2, 0.4, "m"), (0.5, 0.7, "aa")), 1.0)
    expected = [(0.0, 0.2, "sil"), (0.2, 0.4, "m"), (0.4, 0.5, "sil"), (0.5, 0.7, "aa"), (0.7, 1.0, "sil")]
    assert phones(filled) == expected


def test_gaps_of_rounding_belong_to_the_phone_before() -> None:
    filled = without_gaps(timeline((0.0, 0.4, "sil"), (0.404, 0.5, "m"), (0.5, 0.994, "aa")), 1.0)
    assert phones(filled) == [(0.0, 0.404, "sil"), (0.404, 0.5, "m"), (0.5, 0.994, "aa")]


def test_whole_timelines_stay_as_they_are() -> None:
    assert without_gaps(timeline(*ROWS), 0.7) == timeline(*ROWS)
    named = Timeline((Span(0.1, 0.2, Unit("", "bilabial")),))
    assert without_gaps(named, 1.0) is named


def test_a_last_phone_without_an_end_ends_with_the_recording() -> None:
    assert phones(without_gaps(timeline((0.0, float("inf"), "aa")), 0.8)) == [(0.0, 0.8, "aa")]


def test_other_files_are_no_units(tmp_path: Path) -> None:
    (tmp_path / "a.wav").write_bytes(b"RIFF")
    with pytest.raises(
        InputError, match=r"a\.wav: cannot read phones from '\.wav'; use one of \.json, \.npz, \.TextGrid"
    ):
        read_units(tmp_path / "a.wav")
