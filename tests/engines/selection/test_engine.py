from dataclasses import replace

import numpy as np
import pytest

from lipmotion import engines, errors
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.selection_training import SEGMENT_S, target_of
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import Generation, Span, Timeline, Unit, silent_monitor

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
    assert {span.label.unit for span in result.units} <= set(result.trace.states)


def test_given_sources_are_kept_if_they_are_of_the_phone(model: SelectionModel, engine: SelectionEngine) -> None:
    first = engine.generate(model, SPOKEN)

    def edited(label: Unit) -> Generation:
        spans = list(first.units)
        spans[2] = replace(spans[2], label=label)
        return engine.generate(model, replace(SPOKEN, units=Timeline(tuple(spans))))

    other = next(
        each
        for phones in (("b", "aa", "b"), ("s", "aa", "s"), ("m", "aa", "p"))
        for each in [engine.generate(model, speech(timeline(phones))).units[2].label.unit]
        if each != first.units[2].label.unit
    )
    again = edited(replace(first.units[2].label, unit=other))
    assert again.units[2].label.unit == other
    assert [a.label.unit for a in again.units][4:] == [a.label.unit for a in first.units][4:]
    assert np.abs(again.motion.values - first.motion.values).max() > 0
    assert edited(Unit("uw", first.units[2].label.unit)).units[2].label.unit.endswith(" uw")


def test_an_edited_phone_changes_the_motion_near_it_only(model: SelectionModel, engine: SelectionEngine) -> None:
    long = speech(timeline(("b", "aa", "t", "iy", "m", "uw") * 3))
    first = engine.generate(model, long)
    spans = list(first.units)
    spans[2] = Span(spans[2].start_s, spans[2].end_s, Unit("uw"))
    again = engine.generate(model, replace(long, units=Timeline(tuple(spans))))
    changed = np.abs(again.motion.values - first.motion.values).max(axis=1) > 1e-6
    assert changed[int(spans[2].start_s * 100) : int(spans[2].end_s * 100)].any()
    assert not changed[int(spans[5].start_s * 100) :].any()


def test_its_description_counts_units_and_names_stand_ins(model: SelectionModel, engine: SelectionEngine) -> None:
    text = engine.describe(model)
    assert text.startswith(f"{int(model.inventory.usable.sum())} units of {len(model.inventory.names)} recordings")
    assert "ao (aa)" in text


def test_options_out_of_their_range_are_refused() -> None:
    for option, value in (("window", 4), ("window", 13), ("invisible", "p"), ("overlap", "other"), ("most", 0.0)):
        with pytest.raises(errors.InputError, match=option):
            engines.engine_named("selection", {option: value})


def test_silence_longer_than_any_recorded_one_stands_still(model: SelectionModel, engine: SelectionEngine) -> None:
    units = Timeline((*timeline(("b", "aa")).spans[:-1], Span(0.8, 9.0, Unit("sil")), Span(9.0, 9.2, Unit("aa"))))
    opening = engine.generate(model, speech(units)).motion["opening"]
    assert np.abs(np.diff(opening[200:800])).max() < 1e-3


def test_in_noise_the_sound_alone_chooses(model: SelectionModel, engine: SelectionEngine, monkeypatch) -> None:
    costs = model.costs(engine.config)
    unsure = replace(SPOKEN, units_known=False, confidence=0.0)
    assert not target_of(model, costs, unsure).by_sound
    guide = model.guide
    distorted = (guide.predict(unsure)[0], np.ones(len(unsure.features.values)))
    monkeypatch.setattr(type(guide), "predict", lambda *_: distorted)
    target = target_of(model, costs, unsure)
    assert target.by_sound
    assert target.windows.durations_s == pytest.approx(SEGMENT_S, rel=0.1)
    assert not target_of(model, costs, SPOKEN).by_sound  # phones that are known are relied on
    plain = SelectionEngine(replace(engine.config, guide=0.0))
    assert not target_of(model, model.costs(plain.config), unsure).by_sound
    result = engine.generate(model, unsure)
    assert np.corrcoef(result.motion["opening"], distorted[0][:, 0])[0, 1] > 0.8
    assert len(result.units) == len(unsure.units)


def test_without_recorded_silence_the_mouth_rests(engine: SelectionEngine) -> None:
    trimmed = []
    for each in examples(5):
        inside = [n for n, span in enumerate(each.speech.units) if span.label.phone != "sil"]
        first, last = (each.speech.units[inside[n]] for n in (0, -1))
        valid = each.valid.copy()
        valid[: int(first.start_s * 100) + 1] = False
        valid[int(last.end_s * 100) :] = False
        trimmed.append(replace(each, valid=valid))
    learned = SelectionEngine(replace(engine.config, guide=0.0)).fit(trimmed, silent_monitor).model
    opening = engine.generate(learned, SPOKEN).motion["opening"]
    assert np.abs(opening[:40] - learned.rest[0]).max() < 0.03


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("recorded_motion", lambda values: values[:0]),  # nothing is stored
        ("recorded_rows", lambda values: values + 10**5),
        ("unit_times", lambda values: values * 1e3),
        ("recording_first", lambda values: np.concatenate([values[:-1], values[-1:] + 10**7])),  # silence without end
        ("recorded_rows", None),
    ],
)
def test_models_that_contradict_themselves_are_refused(model, engine, name, damage) -> None:
    arrays = engine.to_arrays(model)
    if damage is None:
        arrays["store_kept"] = arrays.pop(name)
    else:
        arrays[name] = damage(arrays[name])
    with pytest.raises(errors.ModelFormatError):
        engine.from_arrays(arrays)


def test_sources_that_cannot_be_used_are_reported(
    model: SelectionModel, engine: SelectionEngine, caplog: pytest.LogCaptureFixture
) -> None:
    first = engine.generate(model, SPOKEN)
    engine.generate(model, replace(SPOKEN, units=first.units))
    assert not caplog.records
    spans = list(first.units)
    spans[2] = replace(spans[2], label=replace(spans[2].label, unit="nosuch 1.000-1.100 s aa"))
    engine.generate(model, replace(SPOKEN, units=Timeline(tuple(spans))))
    assert "1 of 8 units name no recorded unit" in caplog.text
    assert "'nosuch 1.000-1.100 s aa'" in caplog.text
