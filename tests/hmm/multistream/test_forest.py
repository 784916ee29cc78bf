from itertools import product

import numpy as np
import pytest

from hmm.multistream.synthetic import CLASSES, NAMES, inventory, random_joint
from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import GaussianStatistics
from lipmotion.hmm.multistream.model import TreeCosts, choose_positions, context_questions, grow_forest, unit_forest
from lipmotion.hmm.multistream.streams import ACOUSTIC_STREAMS
from lipmotion.hmm.multistream.unit_states import Inventory, expand_triphones

KNOWN = inventory()
SIDES = [name for name in NAMES if name != "sp"]


def test_every_unit_that_is_spoken_has_a_leaf_of_its_own():
    forest = unit_forest(KNOWN, ("sil", "a", "c"))
    leaves = {unit: forest.leaf((("sil", unit, "a"), 1)) for unit in NAMES if unit != "sp"}
    assert leaves["b"] == leaves["x"] == leaves["d"]
    assert len({leaves["a"], leaves["c"], leaves["x"], leaves["sil"]}) == 4
    assert forest.leaf((("a", "sp", "a"), 0)) not in leaves.values()
    assert forest.leaf((("b", "a", "b"), 1)) == leaves["a"]


def triphones(unit_names=NAMES):
    return [((a, b, c), s) for a, b, c in product(SIDES, unit_names, SIDES) for s in range(KNOWN.count(b))]


def tied(stream, mean_of, seen, classes=CLASSES, has_spaces=False):
    means = np.array([mean_of(*state) for state in seen])[:, None]
    sums = GaussianStatistics.zeros(len(seen), 1, 1)
    sums.add(np.arange(len(seen)), 20.0 * np.concatenate([np.ones((len(seen), 2)), means, means**2 + 0.1], axis=1))
    return grow_forest(
        stream, KNOWN, context_questions(KNOWN, classes), seen, sums,
        has_spaces=has_spaces, costs=TreeCosts(1.0, 10.0, 0.02),
    )  # fmt: skip


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

    def differs(unit, state, position):
        found = set()
        for other in sides:
            context = ["sil", unit, "sil"]
            context[position] = other
            found.add(forest.leaf((tuple(context), state)))
        return len(found) > 1

    left = {state for unit, state in hmm.inventory.monophones if unit not in ("sil", "sp") and differs(unit, state, 0)}
    right = {state for unit, state in hmm.inventory.monophones if unit not in ("sil", "sp") and differs(unit, state, 2)}
    silent = any(differs("sil", state, position) for state in range(3) for position in (0, 2))
    one, everywhere = ({0}, {2}, False), ({0, 1, 2}, {0, 1, 2}, stream == "motion")
    assert (left, right, silent) == (one if stream in ACOUSTIC_STREAMS and not both else everywhere)


def test_the_grid_of_leaves_is_the_leaf_beside_each_pair_of_neighbours():
    forest = random_joint(0, ("a", "b", "c"), both_neighbours=True).models["speech"].forest
    for unit, state in (("a", 0), ("c", 1), ("sil", 2)):
        grid = forest.leaf_grid(unit, state, SIDES[:-1])
        expected = [[forest.leaf(((left, unit, right), state)) for right in SIDES[:-1]] for left in SIDES[:-1]]
        assert grid.tolist() == expected


def test_an_even_count_has_no_middle():
    known = inventory(4)
    assert [choose_positions("f0", known, "a", state) for state in range(4)] == [(0, 1), (0, 1), (1, 2), (1, 2)]


def test_silence_stands_for_pauses_beside_other_units():
    contexts = KNOWN.contexts(("sil", "a", "sp", "b"))
    assert contexts == [("sil", "sil", "a"), ("sil", "a", "sil"), ("a", "sp", "b"), ("sil", "b", "sil")]
    states = expand_triphones(KNOWN, ("a", "sp"))
    assert states.positions.tolist() == [0, 0, 0, 1]
    assert [KNOWN.monophones[context[1], state] for context, state in states.triphones] == states.monophones.tolist()


def test_an_inventory_that_is_none_and_an_unknown_unit_are_refused():
    for given in (
        (("a",), (), 3),
        (("a",), ("b",), 3),
        (("a", "a"), ("a",), 3),
        (("a b",), ("a b",), 3),
        (("a",), ("a",), 0),
    ):
        with pytest.raises(InputError):
            Inventory(*given)
    with pytest.raises(InputError, match="unknown unit 'q'"):
        expand_triphones(KNOWN, ("a", "q"))


def test_classes_of_other_units_are_left_out():
    names = {question.name for question in context_questions(KNOWN, {"other": frozenset({"q"}), **CLASSES})}
    assert names == {*CLASSES, *NAMES}
