from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmm.multistream.synthetic import CLASSES, NAMES, config, inventory, random_joint, say, utterances
from hmm.multistream.synthetic import observed as noise
from lipmotion import errors, types
from lipmotion.errors import InputError
from lipmotion.hmm.multistream import densities, model, multistream_training, recognise
from lipmotion.hmm.multistream.densities import F0_STREAMS, STREAMS, ObservedStream, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.unit_states import expand_triphones, frames_to_units, units_to_frames
from lipmotion.types import Unit
from meshes.speech import said
from oracles import joint as slow
from oracles import paths

TRAIN, HELD_OUT = utterances(30), utterances(8, seed=1)
MOTION_ONLY = StreamWeights(0, 0, 0, 0, 1)


def trained(data=TRAIN, **changes):
    events: list[types.Progress] = []
    *_, hmm = multistream_training.grow_joint(data, inventory(), CLASSES, config(**changes), events.append)
    return hmm, events


@pytest.fixture(scope="module")
def usual():
    return trained()


def stages(events):
    found: dict[str, list[float]] = {}
    for event in events:
        if event.stage not in ("trees", "lengths of states"):
            found.setdefault(event.stage, []).append(event.figure)
    return found


def only(observed, *names):
    """Return some streams of what was observed."""
    return StreamObservations({name: observed.streams[name] for name in names})


DEAF = [replace(utterance, observed=only(utterance.observed, "speech")) for utterance in TRAIN[:3]]


@pytest.mark.parametrize(
    "weights", [StreamWeights(), MOTION_ONLY, pytest.param(StreamWeights(0.3, 0.5, 0, 0.1, 2), marks=pytest.mark.long)]
)
def test_the_likelihood_never_falls_within_a_stage(weights):
    data = TRAIN[:10] if weights is MOTION_ONLY else [replace(utterance, bounds=None) for utterance in TRAIN[:10]]
    _, events = trained(data, training=weights, mixtures=4, motion_mixtures=2, plain_iterations=8, iterations=6)
    found = stages(events)
    assert len(found) >= 4
    for figures in found.values():
        assert (np.diff(figures) > -2e-4).all(), figures


def test_posteriors_are_those_of_all_paths():
    for components in (1, 2):
        hmm = random_joint(1, states=2, components=components, training=StreamWeights(0.7, 1.2, 0.4, 1, 0.9))
        observed = only(noise(np.random.default_rng(0), 7), *(name for name in STREAMS if name != "f0_slope"))
        prepared = multistream_training.prepare_utterances(hmm, [(observed, ("a", "sp", "b"))])
        ((item, found),) = multistream_training.infer_batches(hmm, hmm.leaves(prepared.triphones), prepared.items)
        density = [
            [slow.log_density(hmm, observed, prepared.triphones[i], t, hmm.config.training) for i in item.triphones]
            for t in range(7)
        ]
        transitions = hmm.log_stay[item.monophones], hmm.log_move[item.monophones]
        expected, stay, log_likelihood = paths.chain_posteriors(np.array(density), *transitions)
        assert found.states == pytest.approx(expected, abs=1e-4)
        assert found.states.sum(axis=1) == pytest.approx(np.ones(7), abs=1e-9)
        assert found.stay == pytest.approx(stay, abs=1e-4)
        assert found.log_likelihood == pytest.approx(log_likelihood, abs=1e-3)


def test_what_was_learned_is_recognised(usual):
    right = [recognise.recognise_units(usual[0], u.observed)[0] == u.units for u in HELD_OUT]
    assert np.mean(right) >= 0.75


def test_a_stream_counts_as_much_as_its_weight(usual):
    """Voicing of another utterance: the less it weighs, the more units are those that speech says."""
    right = []
    for weight in (0.0, 1.0, 8.0):
        weights, count = StreamWeights(1, weight, weight, weight, 0), 0
        hmm = replace(usual[0], config=replace(usual[0].config, recognition=weights))
        for utterance, other in pairwise(HELD_OUT):
            frames = min(utterance.observed.frames, other.observed.frames)
            mixed = only(other.observed, "speech", *F0_STREAMS).streams | only(utterance.observed, "speech").streams
            cut = {
                name: ObservedStream(stream.values[:frames], stream.known[:frames]) for name, stream in mixed.items()
            }
            said, _ = recognise.recognise_units(hmm, StreamObservations(cut))
            count += sum(a == b for a, b in zip(said, utterance.units, strict=False))
        right.append(count)
    assert right[0] > right[1] > right[2]


def test_a_flat_start_finds_the_units():
    hmm, _ = trained([replace(utterance, bounds=None) for utterance in TRAIN])
    for utterance in HELD_OUT:
        found = recognise.align(hmm, utterance.observed, utterance.units).bounds(len(utterance.units))
        assert np.abs(found - utterance.bounds).max() <= 4


def test_streams_and_units_that_are_missing_here_and_there():
    deaf, pause = DEAF[0], say(np.random.default_rng(7), ["a", "b"])
    hmm, _ = trained([deaf, pause, *TRAIN[1:8]])
    assert set(hmm.models) == set(STREAMS)
    assert hmm.spoken == ("sil", "a", "b", "c", "d")
    path = recognise.align(hmm, HELD_OUT[0].observed, ("sil", "x", "sil"))  # not in the training
    assert len(path.frames) == HELD_OUT[0].observed.frames
    assert np.isfinite(hmm.log_stay).all()


def test_nothing_that_is_switched_on_was_observed():
    with pytest.raises(errors.InputError, match="switched on are motion"):
        trained(DEAF, training=MOTION_ONLY)
    hmm, _ = trained([*TRAIN[:6], DEAF[0]], training=MOTION_ONLY)  # utterances without motion change nothing
    assert np.isfinite(hmm.log_stay).all()


def test_too_short_for_its_units():
    observed = noise(np.random.default_rng(0), 5)
    with pytest.raises(errors.CorpusError, match="room for the states"):
        trained([multistream_training.TrainingUtterance(observed, ("sil", "a", "sil"))])
    with pytest.raises(errors.CorpusError, match="no utterances"):
        trained([])


KNOWN = inventory()
SIDES = [name for name in NAMES if name != "sp"]


def test_every_unit_that_is_spoken_has_a_leaf_of_its_own():
    forest = model.build_unit_forest(KNOWN, ("sil", "a", "c"))
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
    questions, tying = model.list_context_questions(KNOWN, CLASSES), model.JointConfig(least_frames=10.0)
    return model.grow_forest(stream, KNOWN, questions, seen, sums, has_spaces=False, config=tying)


def test_units_and_contexts_that_were_never_seen_resolve_by_class():
    seen = [state for state in triphones() if state[0][1] != "x" and state[0][0] != "c"]
    forest = tied("motion", lambda context, _: float(context[1] in "cdx") + 5.0 * (context[0] in "cdx"), seen)
    assert forest.leaf((("a", "x", "a"), 1)) == forest.leaf((("a", "d", "a"), 1)) != forest.leaf((("a", "b", "a"), 1))
    assert forest.leaf((("x", "a", "a"), 1)) == forest.leaf((("d", "a", "a"), 1)) != forest.leaf((("b", "a", "a"), 1))
    leaf = forest.leaf((("x", "x", "x"), 0))
    assert forest.name(leaf) == "state 0: left is late, unit is not early"


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


def test_silence_stands_for_pauses_beside_other_units():
    contexts = list(dict.fromkeys(context for context, _ in expand_triphones(KNOWN, ("sil", "a", "sp", "b")).triphones))
    assert contexts == [("sil", "sil", "a"), ("sil", "a", "sil"), ("a", "sp", "b"), ("sil", "b", "sil")]
    states = expand_triphones(KNOWN, ("a", "sp"))
    assert states.positions.tolist() == [0, 0, 0, 1]
    assert [KNOWN.monophones[context[1], state] for context, state in states.triphones] == states.monophones.tolist()


def test_every_frame_has_a_unit():
    spoken = said((0.015, 0.05, "a"), (0.05, 0.054, "t"), (0.07, 0.1, "b"))
    units, bounds = units_to_frames(spoken, 13, "sil")
    assert units == ("sil", "a", "t", "sil", "b", "sil")
    assert bounds.tolist() == [0, 2, 5, 6, 7, 10, 13]
    assert units_to_frames(spoken, 4, "sil", lambda label: {"a": "open"}[label.phone])[0] == ("sil", "open")
    assert units_to_frames(said(), 3, "sil")[0] == ("sil",)
    with pytest.raises(InputError):
        units_to_frames(spoken, 0, "sil")


def test_a_unit_begins_half_a_frame_before_its_first_frame():
    spoken = frames_to_units(map(Unit, ("sil", "a", "sil")), np.array([0, 3, 9, 13]), 0.125)
    assert [span.start_s for span in spoken] == pytest.approx([0, 0.025, 0.085])
    assert [span.end_s for span in spoken] == pytest.approx([0.025, 0.085, 0.125])


@settings(max_examples=30)
@given(lengths=st.lists(st.integers(1, 9), min_size=1, max_size=9))
def test_there_and_back(lengths):
    firsts, said = np.cumsum([0, *lengths]), tuple("ab"[i % 2] for i in range(len(lengths)))
    spoken = frames_to_units(map(Unit, said), firsts, firsts[-1] / 100)
    assert spoken[-1].end_s == firsts[-1] / 100
    units, bounds = units_to_frames(spoken, int(firsts[-1]), "sil")
    assert (units, bounds.tolist()) == (said, firsts.tolist())
