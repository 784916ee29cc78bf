from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example as case
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import errors, types
from lipmotion.engines.selection.concatenation import TimeMap, list_shown_units, to_pieces
from lipmotion.engines.selection.costs import select
from lipmotion.engines.selection.inventory import OVERLAPS, TABLE_1, find_lip_class, parse_invisible
from lipmotion.engines.selection.selection_training import SEGMENT_S, build_target
from lipmotion.testing import PHONES, example, examples, speech, timeline
from lipmotion.types import Generation, Span, Timeline, Unit, silent_monitor

SPOKEN = speech(timeline(("b", "aa", "t", "iy", "m", "uw")))


def test_given_sources_are_kept_if_they_are_of_the_phone(model, engine) -> None:
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


def test_an_edited_phone_changes_the_motion_near_it_only(model, engine) -> None:
    long = speech(timeline(("b", "aa", "t", "iy", "m", "uw") * 3))
    first = engine.generate(model, long)
    spans = list(first.units)
    spans[2] = Span(spans[2].start_s, spans[2].end_s, Unit("uw"))
    again = engine.generate(model, replace(long, units=Timeline(tuple(spans))))
    changed = np.abs(again.motion.values - first.motion.values).max(axis=1) > 1e-6
    assert changed[int(spans[2].start_s * 100) : int(spans[2].end_s * 100)].any()
    assert not changed[int(spans[5].start_s * 100) :].any()


def test_silence_longer_than_any_recorded_one_stands_still(model, engine) -> None:
    units = Timeline((*timeline(("b", "aa")).spans[:-1], Span(0.8, 9.0, Unit("sil")), Span(9.0, 9.2, Unit("aa"))))
    opening = engine.generate(model, speech(units)).motion["opening"]
    assert np.abs(np.diff(opening[200:800])).max() < 1e-3


def test_in_noise_the_sound_alone_chooses(model, engine) -> None:
    costs = model.costs(engine.config)
    unsure = replace(SPOKEN, units_known=False, confidence=0.0)
    assert not build_target(model, costs, unsure).by_sound
    guide = model.guide
    distorted = (guide.predictor.predict(unsure)[0], np.ones(len(unsure.features.values)))
    noisy = SimpleNamespace(can_predict=lambda _: True, predict=lambda _: distorted)
    model = replace(model, guide=replace(guide, predictor=noisy))
    target = build_target(model, costs, unsure)
    assert target.by_sound
    assert target.windows.durations_s == pytest.approx(SEGMENT_S, rel=0.1)
    assert not build_target(model, costs, SPOKEN).by_sound  # phones that are known are relied on
    plain = replace(engine, config=replace(engine.config, guide=0.0))
    assert not build_target(model, model.costs(plain.config), unsure).by_sound
    result = engine.generate(model, unsure)
    assert np.corrcoef(result.motion["opening"], distorted[0][:, 0])[0, 1] > 0.8
    assert len(result.units) == len(unsure.units)


def test_without_recorded_silence_the_mouth_rests(engine) -> None:
    trimmed = []
    for each in examples(5):
        inside = [n for n, span in enumerate(each.speech.units) if span.label.phone != "sil"]
        first, last = (each.speech.units[inside[n]] for n in (0, -1))
        valid = each.valid.copy()
        valid[: int(first.start_s * 100) + 1] = False
        valid[int(last.end_s * 100) :] = False
        trimmed.append(replace(each, valid=valid))
    learned = replace(engine, config=replace(engine.config, guide=0.0)).fit(trimmed, silent_monitor).model
    opening = engine.generate(learned, SPOKEN).motion["opening"]
    assert np.abs(opening[:40] - learned.rest[0]).max() < 0.03


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("recorded_rows", lambda values: values + 10**5),
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


def test_sources_that_cannot_be_used_are_reported(model, engine, caplog: pytest.LogCaptureFixture) -> None:
    first = engine.generate(model, SPOKEN)
    engine.generate(model, replace(SPOKEN, units=first.units))
    assert not caplog.records
    spans = list(first.units)
    spans[2] = replace(spans[2], label=replace(spans[2].label, unit="nosuch 1.000-1.100 s aa"))
    engine.generate(model, replace(SPOKEN, units=Timeline(tuple(spans))))
    assert "1 of 8 units name no recorded unit" in caplog.text
    assert "'nosuch 1.000-1.100 s aa'" in caplog.text


SENTENCES = st.lists(st.sampled_from(PHONES), min_size=1, max_size=6)


def wanted(model, engine, phones: list[str]):
    costs = model.costs(engine.config)
    return costs, build_target(model, costs, speech(timeline(phones)))


def total(costs, target, units: list[int]) -> float:
    each = sum(costs.target_costs(target, n, np.array([unit]))[0] for n, unit in enumerate(units))
    joins = (
        costs.join_costs(target, n, np.array([units[n - 1]]), np.array([units[n]]))[0, 0] for n in range(1, len(units))
    )
    return float(each + sum(joins))


@settings(max_examples=12)
@given(st.lists(st.sampled_from(PHONES), min_size=1, max_size=3), st.integers(0, 99))
def test_no_sequence_of_candidates_is_cheaper(model, engine, phones: list[str], seed: int) -> None:
    """Two candidates a bias: at most six a phone, so that every sequence is compared."""
    few = replace(engine, config=replace(engine.config, candidates=2))
    costs, target = wanted(model, few, phones)
    excluded = np.random.default_rng(seed).random(len(model.inventory.windows)) < 0.5
    found = (costs.candidates(target, number, excluded) for number in range(len(target)))
    every = [units if len(units) else costs.candidates(target, number) for number, units in enumerate(found)]
    sums = costs.target_costs(target, 0, every[0])
    for number in range(1, len(target)):
        step = costs.join_costs(target, number, *every[number - 1 : number + 1])
        sums = sums[..., None] + step + costs.target_costs(target, number, every[number])
    units, cost = select(costs, target, excluded)
    assert sums.shape == tuple(map(len, every))
    assert cost == pytest.approx(sums.min())
    assert total(costs, target, units.tolist()) == pytest.approx(cost)


@settings(max_examples=12)
@given(SENTENCES)
def test_pruning_does_not_change_the_cost(model, engine, phones: list[str]) -> None:
    wide = replace(engine, config=replace(engine.config, beam=10**6, most=0.4))
    costs, target = wanted(model, wide, phones)
    assert select(costs, target)[1] == pytest.approx(select(costs, target, prune=False)[1])


LONGER = st.lists(st.sampled_from(PHONES), min_size=2, max_size=8)


def laid_out(model, engine, units: types.Timeline):
    costs = model.costs(engine.config)
    target = build_target(model, costs, speech(units))
    pieces = to_pieces(costs, target, select(costs, target)[0])
    return target, pieces


@settings(max_examples=15)
@given(LONGER, st.floats(0.04, 0.3))
def test_edges_of_phones_fall_on_edges_of_phones(model, engine, phones: list[str], duration_s: float) -> None:
    target, pieces = laid_out(model, engine, timeline(phones, duration_s))
    assert (pieces[0].first, pieces[-1].stop) == (0, len(target))
    assert all(one.stop == two.first and one.start_s < two.start_s for one, two in pairwise(pieces))
    recorded = model.inventory.windows.times_s
    for piece in pieces:
        clock = TimeMap.of(model.inventory, target, piece)
        starts = target.windows.times_s[piece.first : piece.stop, 0]
        wanted = recorded[piece.unit : piece.unit + len(starts), 0]
        assert clock(starts) == pytest.approx(wanted, abs=2e-3)
        assert (np.diff(clock(np.arange(0, target.windows.times_s[-1, 1], 0.005))) > -1e-9).all()


def test_classes_of_lip_reading_and_their_overlaps() -> None:
    """The symmetric table is Table 1 but for one entry; read with the phone after as forward, it is but for two."""
    assert OVERLAPS["symmetric"]["normal", "invisible"] == pytest.approx(1 - TABLE_1["invisible", "normal"])
    other = {pair: share for pair, share in OVERLAPS["anticipatory"].items() if share != pytest.approx(TABLE_1[pair])}
    assert other == pytest.approx({("invisible", "normal"): 0.23, ("normal", "invisible"): 0.73})
    classes = [find_lip_class(phone, parse_invisible("t d g k")) for phone in ("b", "t", "l", "aa")]
    assert classes == ["protected", "invisible", "normal", "normal"]
    for text in ("t xx", "sil", "p"):
        with pytest.raises(errors.InputError, match="cannot be invisible"):
            parse_invisible(text)


@settings(max_examples=20)
@given(LONGER, st.integers(0, 999))
@case(["t", "aa", "uw", "t"], 3)
@case(["t", "m", "t", "b"], 11)
def test_every_unit_is_shown(model, engine, phones: list[str], seed: int) -> None:
    costs = model.costs(engine.config)
    target = build_target(model, costs, speech(timeline(phones)))
    excluded = np.random.default_rng(seed).random(len(model.inventory.windows)) < 0.7
    units = select(costs, target, excluded)[0]
    pieces = to_pieces(costs, target, units)
    assert all(two.start_s - one.start_s > 0.01 for one, two in pairwise(pieces))
    shown = list_shown_units(target, pieces, int(target.windows.times_s[-1, 1] * 100))
    assert set(units.tolist()) <= set(shown.tolist())


def test_a_recorded_sentence_comes_back_as_it_was_recorded(engine) -> None:
    engine = replace(engine, config=replace(engine.config, guide=0.0))
    recorded = [example(phones, seed) for seed, phones in enumerate((("b", "aa", "t", "iy"), ("m", "uw", "s", "p")))]
    model = engine.fit(recorded, types.silent_monitor).model
    for one in recorded:
        again = engine.generate(model, one.speech)
        assert len({source.split(" ")[0] for source in again.trace.states}) == 1
        near = slice(20, len(one.motion.values) - 20)  # silence far from speech is not stored
        difference = np.abs(again.motion.values - one.motion.values)[near, :2]
        assert np.percentile(difference, 99) < 0.02  # recorded motion has noise that few components leave out
