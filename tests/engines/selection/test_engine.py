"""The engine: sources of units, edits, reports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.engines import engine_named
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.errors import InputError
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import Constraints, Pin, Span, Timeline, Unit

SPOKEN = speech(timeline(("b", "aa", "t", "iy", "m", "uw")))


def test_every_unit_says_which_recording_it_comes_from(model: SelectionModel, engine: SelectionEngine) -> None:
    names = {each.name for each in examples()}
    result = engine.generate(model, SPOKEN)
    for span in result.units:
        recording, times, unit, phone = span.label.unit.split(" ")
        assert recording in names
        assert unit == "s"
        assert float(times.split("-")[0]) < float(times.split("-")[1])
        assert span.label.phone in (phone, "t")  # t is suppressed
    assert len(result.trace.frames) == len(result.motion.values)
    assert set(result.trace.states) == {span.label.unit for span in result.units}


def test_given_sources_are_kept(model: SelectionModel, engine: SelectionEngine) -> None:
    first = engine.generate(model, SPOKEN)
    other = next(
        each
        for phones in (("b", "aa", "b"), ("s", "aa", "s"), ("m", "aa", "p"))
        for each in [engine.generate(model, speech(timeline(phones))).units[2].label.unit]
        if each != first.units[2].label.unit
    )
    spans = list(first.units)
    spans[2] = replace(spans[2], label=replace(spans[2].label, unit=other))
    again = engine.generate(model, replace(SPOKEN, units=Timeline(tuple(spans))))
    assert again.units[2].label.unit == other
    assert [a.label.unit for a in again.units][4:] == [a.label.unit for a in first.units][4:]
    assert np.abs(again.motion.values - first.motion.values).max() > 0


def test_a_source_of_another_phone_is_not_used(model: SelectionModel, engine: SelectionEngine) -> None:
    first = engine.generate(model, SPOKEN)
    spans = list(first.units)
    spans[2] = replace(spans[2], label=Unit("uw", spans[2].label.unit))
    again = engine.generate(model, replace(SPOKEN, units=Timeline(tuple(spans))))
    assert again.units[2].label.unit.endswith(" uw")


def test_an_edited_phone_changes_the_motion_near_it_only(model: SelectionModel, engine: SelectionEngine) -> None:
    long = speech(timeline(("b", "aa", "t", "iy", "m", "uw") * 3))
    first = engine.generate(model, long)
    spans = list(first.units)
    spans[2] = Span(spans[2].start_s, spans[2].end_s, Unit("uw"))
    again = engine.generate(model, replace(long, units=Timeline(tuple(spans))))
    changed = np.abs(again.motion.values - first.motion.values).max(axis=1) > 1e-6
    assert changed[int(spans[2].start_s * 100) : int(spans[2].end_s * 100)].any()
    assert not changed[int(spans[5].start_s * 100) :].any()


def test_pins_are_met(model: SelectionModel, engine: SelectionEngine) -> None:
    result = engine.generate(model, SPOKEN, Constraints((Pin(0.7, "opening", 0.2), Pin(0.9, "width", 0.5))))
    assert result.motion["opening"][70] == pytest.approx(0.2)
    assert result.motion["width"][90] == pytest.approx(0.5)


def test_its_description_counts_units_and_names_stand_ins(model: SelectionModel, engine: SelectionEngine) -> None:
    text = engine.describe(model)
    assert text.startswith(f"{int(model.inventory.usable.sum())} units of {len(model.inventory.names)} recordings")
    assert "ao (aa)" in text


@pytest.mark.parametrize(
    ("option", "value"),
    [("window", 4), ("window", 13), ("invisible", "p"), ("overlap", "other"), ("candidates", 0), ("most", 0.0)],
)
def test_options_out_of_their_range_are_refused(option: str, value: object) -> None:
    with pytest.raises(InputError, match=option if option != "invisible" else "invisible"):
        engine_named("selection", {option: value})


def test_silence_longer_than_any_recorded_one_stands_still(model: SelectionModel, engine: SelectionEngine) -> None:
    units = Timeline((*timeline(("b", "aa")).spans[:-1], Span(0.8, 9.0, Unit("sil")), Span(9.0, 9.2, Unit("aa"))))
    opening = engine.generate(model, speech(units)).motion["opening"]
    assert np.abs(np.diff(opening[200:800])).max() < 1e-3
