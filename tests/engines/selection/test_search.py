from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engines.selection.conftest import SETTINGS
from lipmotion import errors, types
from lipmotion.engines.selection.concatenation import TimeMap, concatenated, pieces_of, shown_units
from lipmotion.engines.selection.costs import ABUTTING_JOIN, Costs, Target, select
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.selection_training import target_of
from lipmotion.engines.selection.windows import OVERLAPS, TABLE_1, lip_reading_class, parsed_invisible
from lipmotion.testing.examples import OPENINGS, example, speech, timeline
from lipmotion.testing.examples import PHONES as SPOKEN

SENTENCES = st.lists(st.sampled_from(SPOKEN), min_size=1, max_size=6)


def wanted(model: SelectionModel, engine, phones: list[str]) -> tuple[Costs, Target]:
    costs = model.costs(engine.config)
    return costs, target_of(model, costs, speech(timeline(phones)))


def total(costs: Costs, target: Target, units: list[int]) -> float:
    each = sum(costs.target_costs(target, n, np.array([unit]))[0] for n, unit in enumerate(units))
    joins = (
        costs.join_costs(target, n, np.array([units[n - 1]]), np.array([units[n]]))[0, 0] for n in range(1, len(units))
    )
    return float(each + sum(joins))


@settings(max_examples=12)
@given(st.lists(st.sampled_from(SPOKEN), min_size=1, max_size=3), st.integers(0, 99))
def test_no_sequence_of_candidates_is_cheaper(model: SelectionModel, engine, phones: list[str], seed: int) -> None:
    """Two candidates a bias: at most six a phone, so that every sequence is compared."""
    few = SelectionEngine(replace(engine.config, candidates=2))
    costs, target = wanted(model, few, phones)
    excluded = np.random.default_rng(seed).random(len(model.inventory.windows)) < 0.5
    found = (costs.candidates(target, number, excluded) for number in range(len(target)))
    every = [units if len(units) else costs.candidates(target, number) for number, units in enumerate(found)]
    sums = costs.target_costs(target, 0, every[0])
    for number in range(1, len(target)):
        step = costs.join_costs(target, number, *every[number - 1 : number + 1])
        sums = sums[..., None] + step + costs.target_costs(target, number, every[number])
    chosen = select(costs, target, excluded)
    assert sums.shape == tuple(map(len, every))
    assert chosen.cost == pytest.approx(sums.min())
    assert total(costs, target, chosen.units.tolist()) == pytest.approx(chosen.cost)


@settings(max_examples=12)
@given(SENTENCES)
def test_pruning_does_not_change_the_cost(model: SelectionModel, engine, phones: list[str]) -> None:
    wide = SelectionEngine(replace(engine.config, beam=10**6, most=0.4))
    costs, target = wanted(model, wide, phones)
    assert select(costs, target).cost == pytest.approx(select(costs, target, prune=False).cost)


LONGER = st.lists(st.sampled_from(tuple(OPENINGS)), min_size=2, max_size=8)


def laid_out(model: SelectionModel, engine: SelectionEngine, units: types.Timeline):
    costs = model.costs(engine.config)
    target = target_of(model, costs, speech(units))
    pieces = pieces_of(costs, target, select(costs, target).units)
    return target, pieces


@settings(max_examples=15)
@given(LONGER, st.floats(0.04, 0.3))
def test_edges_of_phones_fall_on_edges_of_phones(
    model: SelectionModel, engine: SelectionEngine, phones: list[str], duration_s: float
) -> None:
    target, pieces = laid_out(model, engine, timeline(phones, duration_s))
    assert (pieces[0].first, pieces[-1].stop) == (0, len(target))
    assert all(one.stop == two.first and one.start_s < two.start_s for one, two in pairwise(pieces))
    recorded = model.inventory.windows.times_s
    for piece, following in zip(pieces, [*pieces[1:], None], strict=True):
        clock = TimeMap.of(model.inventory, target, piece, following)
        starts = target.windows.times_s[piece.first : piece.stop, 0]
        wanted = recorded[piece.unit : piece.unit + len(starts), 0]
        assert clock(starts) == pytest.approx(wanted, abs=2e-3)
        assert (np.diff(clock(np.arange(0, target.windows.times_s[-1, 1], 0.005))) > -1e-9).all()


@settings(max_examples=15)
@given(LONGER)
def test_motion_stays_within_what_was_recorded_and_no_join_is_a_jump(
    model: SelectionModel, engine: SelectionEngine, phones: list[str]
) -> None:
    target, pieces = laid_out(model, engine, timeline(phones))
    frames = int(target.windows.times_s[-1, 1] * 100)
    motion, recorded = concatenated(model.inventory, target, pieces, frames), model.inventory.values
    jump = np.ptp(recorded, axis=0)  # by which a hard join beside a protected phone may bend the other side
    assert (motion >= recorded.min(axis=0) - jump).all()
    assert (motion <= recorded.max(axis=0) + jump).all()
    largest = np.abs(np.diff(recorded, axis=0)).max(axis=0)
    hard = any(piece.join == ABUTTING_JOIN for piece in pieces[1:])
    bend = hard * jump * np.pi / 4  # within two frames, where pieces abut
    assert (np.abs(np.diff(motion, axis=0)).max(axis=0) < 3 * largest + bend).all()


def test_classes_of_lip_reading_and_their_overlaps() -> None:
    """The symmetric table is Table 1 but for one entry; read with the phone after as forward, it is but for two."""
    assert OVERLAPS["symmetric"]["normal", "invisible"] == pytest.approx(1 - TABLE_1["invisible", "normal"])
    other = {pair: share for pair, share in OVERLAPS["anticipatory"].items() if share != pytest.approx(TABLE_1[pair])}
    assert other == pytest.approx({("invisible", "normal"): 0.23, ("normal", "invisible"): 0.73})
    classes = [lip_reading_class(phone, parsed_invisible("t d g k")) for phone in ("b", "t", "l", "aa")]
    assert classes == ["protected", "invisible", "normal", "normal"]
    for text in ("t xx", "sil", "p"):
        with pytest.raises(errors.InputError, match="cannot be invisible"):
            parsed_invisible(text)


@settings(max_examples=20)
@given(LONGER, st.integers(0, 999))
def test_every_unit_is_shown(model: SelectionModel, engine: SelectionEngine, phones: list[str], seed: int) -> None:
    costs = model.costs(engine.config)
    target = target_of(model, costs, speech(timeline(phones)))
    excluded = np.random.default_rng(seed).random(len(model.inventory.windows)) < 0.7
    units = select(costs, target, excluded).units
    pieces = pieces_of(costs, target, units)
    assert all(two.start_s - one.start_s > 0.01 for one, two in pairwise(pieces))
    shown = shown_units(target, pieces, int(target.windows.times_s[-1, 1] * 100))
    assert set(units.tolist()) <= set(shown.tolist())


def test_a_recorded_sentence_comes_back_as_it_was_recorded() -> None:
    engine = SelectionEngine(replace(SETTINGS, guide=0.0))
    recorded = [example(phones, seed) for seed, phones in enumerate((("b", "aa", "t", "iy"), ("m", "uw", "s", "p")))]
    model = engine.fit(recorded, types.silent_monitor).model
    for one in recorded:
        again = engine.generate(model, one.speech)
        assert len({source.split(" ")[0] for source in again.trace.states}) == 1
        near = slice(20, len(one.motion.values) - 20)  # silence far from speech is not stored
        difference = np.abs(again.motion.values - one.motion.values)[near, :2]
        assert np.percentile(difference, 99) < 0.02  # recorded motion has noise that few components leave out
