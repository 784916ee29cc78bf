import numpy as np
import pytest

from hmm.multistream.synthetic import CLASSES, config, inventory, observed, random_joint, utterances
from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.multistream import densities, multistream_training, recognise, unit_states
from oracles import joint as slow
from oracles.sequences import segmentations

WEIGHTS = densities.StreamWeights(1, 0.5, 0.2, 1, 0.7)


def slow_scores(hmm, data, units, weights):
    """Give the score (emissions and transitions) and the durations of every segmentation."""
    states = unit_states.expand_triphones(hmm.inventory, units)
    density = np.array(
        [[slow.log_density(hmm, data, state, t, weights) for state in states.triphones] for t in range(data.frames)]
    )
    stay = hmm.log_stay[states.monophones]
    for lengths in segmentations(data.frames, len(states.monophones)):
        path = np.repeat(np.arange(len(lengths)), lengths)
        kept = ((np.array(lengths) - 1) * stay + np.log(1 - np.exp(stay))).sum()
        yield float(density[np.arange(data.frames), path].sum() + kept), lengths


@pytest.mark.parametrize("bounds", [None, [0, 4, 6, 9]])
def test_no_other_path_is_more_probable(bounds):
    for seed in range(2):
        hmm = random_joint(seed, states=2)
        data, units = observed(np.random.default_rng([seed, 1]), 9), ("sil", "a", "b")
        scores = slow_scores(hmm, data, units, WEIGHTS)
        _, lengths = max(each for each in scores if bounds in (None, np.cumsum([0, *each[1]])[::2].tolist()))
        path = recognise.align(hmm, data, units, None if bounds is None else np.array(bounds), WEIGHTS)
        assert path.frames.tolist() == np.repeat(np.arange(6), lengths).tolist()
        assert path.bounds(3).tolist() == np.cumsum([0, *lengths])[::2].tolist()


def test_short_units_have_some_of_their_states():
    hmm, data = random_joint(0), observed(np.random.default_rng(1), 10)
    path = recognise.align(hmm, data, ("sil", "a", "b", "a", "sil"), np.array([0, 3, 5, 6, 6, 10]))
    assert path.frames.tolist()[:6] == [0, 1, 2, 3, 5, 7]
    assert path.bounds(5).tolist() == [0, 3, 5, 6, 6, 10]


def test_durations_are_those_of_the_alignment():
    data = utterances(12)
    hmm = multistream_training.train_joint(data, inventory(), CLASSES, config(mixtures=1))
    durations = recognise.measure_durations(hmm, [(u.observed, u.units) for u in data])
    assert np.array_equal(durations, hmm.durations)
    rows = [hmm.inventory.monophones["a", state] for state in range(3)]
    assert 6 <= durations[rows, 0].sum() <= 12
    assert (durations[:, 1] >= 1).all()


def test_what_does_not_fit_is_refused():
    hmm, data = random_joint(6), observed(np.random.default_rng(7), 8)
    with pytest.raises(AlignmentError, match="at least 9 frames"):
        recognise.align(hmm, data, ("a", "b", "a"))
    for bounds in ([0, 8], [0, 9, 8], [1, 4, 8], [0, 4, 9]):
        with pytest.raises(InputError, match="bounds"):
            recognise.align(hmm, data, ("a", "b"), np.array(bounds))
    with pytest.raises(InputError, match="unknown unit"):
        recognise.align(hmm, data, ("q",))
