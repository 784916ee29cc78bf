import numpy as np
import pytest

from hmm.synthetic import random_hmm
from lipmotion.errors import ModelFormatError
from lipmotion.hmm.align import align_units
from lipmotion.hmm.log_likelihoods import compute_log_likelihoods
from lipmotion.hmm.model import hmm_from_arrays, hmm_to_arrays


def test_models_come_back_from_arrays():
    hmm = random_hmm(1, contexts=5)
    back = hmm_from_arrays(hmm_to_arrays(hmm), hmm.config)
    assert back.table == hmm.table
    assert back.bigram.units == hmm.bigram.units
    assert np.array_equal(back.log_stay, hmm.log_stay)
    assert np.array_equal(back.bigram.log_probability, hmm.bigram.log_probability)
    features = np.random.default_rng(1).normal(0, 1.5, (30, 2)).astype(np.float32)
    assert back.mixtures.log_likelihood(features) == pytest.approx(hmm.mixtures.log_likelihood(features), abs=0.1)
    units = ("sil", "a", "b", "sil")
    assert np.array_equal(
        align_units(back, compute_log_likelihoods(back, features), units),
        align_units(hmm, compute_log_likelihoods(hmm, features), units),
    )


def test_switched_off_components_stay_off():
    hmm = random_hmm(3)
    hmm.mixtures.log_weights[0] = [0, -np.inf]
    back = hmm_from_arrays(hmm_to_arrays(hmm), hmm.config)
    assert back.mixtures.log_weights[0].tolist() == [0, -np.inf]


def test_a_missing_array_and_one_of_the_wrong_shape_are_a_damaged_model():
    hmm = random_hmm(5, contexts=2)
    whole = hmm_to_arrays(hmm)
    for name in whole:
        with pytest.raises(ModelFormatError, match=name):
            hmm_from_arrays({other: array for other, array in whole.items() if other != name}, hmm.config)
    for name in ("means", "variances", "names", "log_weights", "log_stay", "bigram", "counts"):
        with pytest.raises(ModelFormatError, match="damaged"):
            hmm_from_arrays(whole | {name: whole[name][:-1]}, hmm.config)
