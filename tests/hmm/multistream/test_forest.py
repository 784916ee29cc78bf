from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmm.multistream.synthetic import CLASSES, NAMES, inventory, random_joint
from lipmotion.errors import InputError
from lipmotion.hmm.multistream import densities, model
from lipmotion.hmm.multistream.unit_states import (
    Inventory,
    RecognisedUnit,
    expand_triphones,
    frames_to_units,
    units_to_frames,
)
from meshes.speech import said

KNOWN = inventory()
SIDES = [name for name in NAMES if name != "sp"]


def test_every_unit_that_is_spoken_has_a_leaf_of_its_own():
    forest = model.unit_forest(KNOWN, ("sil", "a", "c"))
    leaves = {unit: forest.leaf((("sil", unit, "a"), 1)) for unit in NAMES if unit != "sp"}
    assert leaves["b"] == leaves["x"] == leaves["d"]
    assert len({leaves["a"], leaves["c"], leaves["x"], leaves["sil"]}) == 4
    assert forest.leaf((("a", "sp", "a"), 0)) not in leaves.values()
    assert forest.leaf((("b", "a", "b"), 1)) == leaves["a"]


def triphones():
    return [((a, b, c), s) for a, b, c in product(SIDES, NAMES, SIDES) for s in range(KNOWN.count(b))]


def tied(stream, mean_of, seen):
    means = np.array([mean_of(*state) for state in seen])[:, None]
    sums = densities.GaussianStatistics.zeros(len(seen), 1, 1)
    sums.add(np.arange(len(seen)), 20.0 * np.concatenate([np.ones((len(seen), 2)), means, means**2 + 0.1], axis=1))
    questions, costs = model.context_questions(KNOWN, CLASSES), model.TreeCosts(1.0, 10.0, 0.02)
    return model.grow_forest(stream, KNOWN, questions, seen, sums, has_spaces=False, costs=costs)


def test_units_and_contexts_that_were_never_seen_resolve_by_class():
    seen = [state for state in triphones() if state[0][1] != "x" and state[0][0] != "c"]
    forest = tied("motion", lambda context, _: float(context[1] in "cdx") + 5.0 * (context[0] in "cdx"), seen)
    assert forest.leaf((("a", "x", "a"), 1)) == forest.leaf((("a", "d", "a"), 1)) != forest.leaf((("a", "b", "a"), 1))
    assert forest.leaf((("x", "a", "a"), 1)) == forest.leaf((("d", "a", "a"), 1)) != forest.leaf((("b", "a", "a"), 1))
    leaf = forest.leaf((("x", "x", "x"), 0))
    assert forest.name(leaf) == "state 0: left is late, unit is not early"
    assert "left is late?" in forest.text()


@pytest.mark.parametrize(
    ("stream", "both"), [("speech", False), ("f0", False), ("motion", False), ("speech", True), ("f0", True)]
)
def test_acoustic_streams_depend_on_one_neighbour_unless_both_are_asked_about(stream, both):
    hmm = random_joint(0, ("a", "b", "c"), both_neighbours=both)
    forest, units = hmm.models[stream].forest, hmm.inventory.names
    sides = [name for name in units if name != "sp"]

    def depends(unit, state, position):
        contexts = [(other, unit, "sil") if position == 0 else ("sil", unit, other) for other in sides]
        return len({forest.leaf((context, state)) for context in contexts}) > 1

    left, right = (
        {s for unit, s in hmm.inventory.monophones if unit not in ("sil", "sp") and depends(unit, s, position)}
        for position in (0, 2)
    )
    silent = any(depends("sil", state, position) for state in range(3) for position in (0, 2))
    one, everywhere = ({0}, {2}, False), ({0, 1, 2}, {0, 1, 2}, stream == "motion")
    assert (left, right, silent) == (one if stream in densities.ACOUSTIC_STREAMS and not both else everywhere)


def test_the_grid_of_leaves_is_the_leaf_beside_each_pair_of_neighbours():
    forest = random_joint(0, ("a", "b", "c"), both_neighbours=True).models["speech"].forest
    for unit, state in (("a", 0), ("c", 1), ("sil", 2)):
        grid = forest.leaf_grid(unit, state, SIDES[:-1])
        expected = [[forest.leaf(((left, unit, right), state)) for right in SIDES[:-1]] for left in SIDES[:-1]]
        assert grid.tolist() == expected


def test_an_even_count_has_no_middle():
    known = inventory(4)
    assert [model.choose_positions("f0", known, "a", state) for state in range(4)] == [(0, 1), (0, 1), (1, 2), (1, 2)]


def test_silence_stands_for_pauses_beside_other_units():
    contexts = KNOWN.contexts(("sil", "a", "sp", "b"))
    assert contexts == [("sil", "sil", "a"), ("sil", "a", "sil"), ("a", "sp", "b"), ("sil", "b", "sil")]
    states = expand_triphones(KNOWN, ("a", "sp"))
    assert states.positions.tolist() == [0, 0, 0, 1]
    assert [KNOWN.monophones[context[1], state] for context, state in states.triphones] == states.monophones.tolist()


def test_an_inventory_that_is_none_and_an_unknown_unit_are_refused():
    for names, free, states in (("a", "", 3), ("a", "b", 3), ("aa", "a", 3), (["a b"], ["a b"], 3), ("a", "a", 0)):
        with pytest.raises(InputError):
            Inventory(tuple(names), tuple(free), states)
    with pytest.raises(InputError, match="unknown unit 'q'"):
        expand_triphones(KNOWN, ("a", "q"))


def test_classes_of_other_units_are_left_out():
    names = {question.name for question in model.context_questions(KNOWN, {"other": frozenset({"q"}), **CLASSES})}
    assert names == {*CLASSES, *NAMES}


def test_every_frame_has_a_unit():
    spoken = said((0.015, 0.05, "a"), (0.05, 0.054, "t"), (0.07, 0.1, "b"))
    units, bounds = units_to_frames(spoken, 13, "sil")
    assert units == ("sil", "a", "t", "sil", "b", "sil")
    assert bounds.tolist() == [0, 2, 5, 6, 7, 10, 13]
    assert units_to_frames(spoken, 4, "sil", lambda label: {"a": "open"}[label.phone])[0] == ("sil", "open")
    assert units_to_frames(said(), 3, "sil")[0] == ("sil",)
    with pytest.raises(InputError):
        units_to_frames(spoken, 0, "sil")


def test_a_unit_without_a_frame_is_left_out():
    units, bounds = units_to_frames(said((0, 0.031, "a"), (0.031, 0.038, "t"), (0.038, 0.06, "b")), 6, "sil")
    assert units == ("a", "b")
    assert bounds.tolist() == [0, 4, 6]


def test_a_unit_begins_half_a_frame_before_its_first_frame():
    spoken = frames_to_units([RecognisedUnit("sil", 0), RecognisedUnit("a", 3), RecognisedUnit("sil", 9)], 0.125)
    assert [span.start_s for span in spoken] == pytest.approx([0, 0.025, 0.085])
    assert [span.end_s for span in spoken] == pytest.approx([0.025, 0.085, 0.125])


@settings(max_examples=30)
@given(lengths=st.lists(st.integers(1, 9), min_size=1, max_size=9))
def test_there_and_back(lengths):
    firsts = np.cumsum([0, *lengths]).tolist()
    said = [RecognisedUnit("ab"[i % 2], first) for i, first in enumerate(firsts[:-1])]
    spoken = frames_to_units(said, firsts[-1] / 100)
    assert spoken[-1].end_s == firsts[-1] / 100
    units, bounds = units_to_frames(spoken, firsts[-1], "sil")
    assert [RecognisedUnit(unit, first) for unit, first in zip(units, bounds[:-1].tolist(), strict=True)] == said
