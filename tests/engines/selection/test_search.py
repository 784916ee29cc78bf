"""The dynamic programming: exact, with and without pruning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.search import select
from lipmotion.engines.selection.selection_training import target_of
from lipmotion.testing.examples import PHONES as SPOKEN
from lipmotion.testing.examples import speech, timeline

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


def test_units_recorded_in_succession_cost_no_join(model: SelectionModel, engine) -> None:
    costs, target = wanted(model, engine, ["b", "aa"])
    units = np.flatnonzero(model.inventory.windows.continues)[:5]
    assert np.diag(costs.join_costs(target, 2, units, units + 1)) == pytest.approx(0)


def test_a_given_unit_is_used(model: SelectionModel, engine) -> None:
    costs, target = wanted(model, engine, ["b", "aa"])
    free = select(costs, target)
    others = costs.index.candidates(target.contexts[1], 50)
    other = int(others[others != free.units[1]][0])
    forced = select(costs, target, given={1: other})
    assert forced.units[1] == other
    assert forced.cost >= free.cost - 1e-9


def test_a_join_inside_a_protected_phone_costs_more(model: SelectionModel, engine) -> None:
    costs, target = wanted(model, engine, ["aa", "b", "iy", "uw"])
    windows = model.inventory.windows
    usable = np.flatnonzero(model.inventory.usable)
    left, right = usable[windows.recording[usable] == 0][:6], usable[windows.recording[usable] == 3][:6]
    protected, plain = costs.join_costs(target, 2, left, right), costs.join_costs(target, 4, left, right)
    assert protected.min() > plain.min() + 0.5
