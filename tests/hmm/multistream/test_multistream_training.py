from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hmm.multistream.synthetic import CLASSES, config, inventory, random_joint, say, utterances
from hmm.multistream.synthetic import observed as noise
from lipmotion import errors, types
from lipmotion.hmm.multistream import model, multistream_training, recognise
from lipmotion.hmm.multistream.densities import F0_STREAMS, STREAMS, ObservedStream, StreamObservations, StreamWeights
from oracles import joint as slow
from oracles import paths

TRAIN, HELD_OUT = utterances(30), utterances(8, seed=1)


def trained(data=TRAIN, **changes):
    events: list[types.Progress] = []
    return multistream_training.train_joint(data, inventory(), CLASSES, config(**changes), events.append), events


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
    "weights",
    [StreamWeights(), model.MOTION_ONLY, pytest.param(StreamWeights(0.3, 0.5, 0, 0.1, 2), marks=pytest.mark.long)],
)
def test_the_likelihood_never_falls_within_a_stage(weights):
    data = TRAIN[:10] if weights is model.MOTION_ONLY else [replace(utterance, bounds=None) for utterance in TRAIN[:10]]
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
        ((item, found),) = multistream_training.batch_posteriors(hmm, prepared.leaves(hmm), prepared.items)
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


def test_a_stream_without_weight_is_as_good_as_absent():
    off = StreamWeights(motion=0, f0=0)
    hmm, events = trained(TRAIN[:12], training=off)
    rest = [name for name in STREAMS if name not in ("motion", "f0")]
    alone, same = trained([replace(u, observed=only(u.observed, *rest)) for u in TRAIN[:12]], training=off)
    found, wanted = ([e.figure for e in each if e.stage in stages(same)] for each in (events, same))
    assert found == pytest.approx(wanted, abs=1e-9)
    assert np.array_equal(hmm.models["speech"].tied.mixtures.means, alone.models["speech"].tied.mixtures.means)
    assert "motion" in hmm.models
    assert "motion" not in alone.models


def test_what_was_learned_is_recognised(usual):
    recogniser = recognise.JointRecogniser(usual[0])
    right = [tuple(s.unit for s in recogniser.recognise(u.observed)) == u.units for u in HELD_OUT]
    assert np.mean(right) >= 0.75


def test_a_stream_counts_as_much_as_its_weight(usual):
    """Voicing of another utterance: the less it weighs, the more units are those that speech says."""
    right = []
    for weight in (0.0, 1.0, 8.0):
        recogniser, count = recognise.JointRecogniser(usual[0], StreamWeights(1, weight, weight, weight, 0)), 0
        for utterance, other in pairwise(HELD_OUT):
            frames = min(utterance.observed.frames, other.observed.frames)
            mixed = only(other.observed, "speech", *F0_STREAMS).streams | only(utterance.observed, "speech").streams
            cut = {
                name: ObservedStream(stream.values[:frames], stream.known[:frames]) for name, stream in mixed.items()
            }
            said = [s.unit for s in recogniser.recognise(StreamObservations(cut))]
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
    assert np.isfinite(hmm.durations).all()


def test_nothing_that_is_switched_on_was_observed():
    with pytest.raises(errors.InputError, match="switched on are motion"):
        trained(DEAF, training=model.MOTION_ONLY)
    hmm, _ = trained([*TRAIN[:6], DEAF[0]], training=model.MOTION_ONLY)  # utterances without motion change nothing
    assert np.isfinite(hmm.durations).all()


def test_too_short_for_its_units():
    observed = noise(np.random.default_rng(0), 5)
    with pytest.raises(errors.CorpusError, match="room for the states"):
        trained([multistream_training.TrainingUtterance(observed, ("sil", "a", "sil"))])
    with pytest.raises(errors.CorpusError, match="no utterances"):
        trained([])


def test_bounds_are_those_of_the_units_and_a_configuration_is_in_its_range():
    for bounds in ([0, 3], [0, 3, 4], [1, 3, 5], [0, 4, 3, 5]):
        with pytest.raises(errors.InputError, match="bounds"):
            multistream_training.TrainingUtterance(noise(np.random.default_rng(0), 5), ("a", "b"), np.array(bounds))
    for changes in ({"mixtures": 0}, {"insertion": float("nan")}, {"training": StreamWeights(0, 0, 0, 0, 0)}):
        with pytest.raises(errors.InputError):
            config(**changes)
