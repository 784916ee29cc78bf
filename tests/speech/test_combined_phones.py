from __future__ import annotations

import numpy as np
import pytest

from lipmotion import Model
from lipmotion.speech.recognition import general as module
from lipmotion.speech.recognition.general import NOISES, combine_phones, combined_log_likelihoods, general_model
from lipmotion.units import PHONES, SILENCE


def test_all_phones_are_there_and_the_own_ones_are_as_they_were(toy_model: Model) -> None:
    own = toy_model.phones
    combined = combine_phones(own)
    table = combined.hmm.table
    assert set(table.units) == {*PHONES, *NOISES}
    assert table.free[0] == SILENCE
    assert len(combined.columns) == len(table.names) == len(combined.hmm.mixtures.means)
    for index, name in enumerate(own.table.names):
        there = table.names.index(name)
        assert np.array_equal(combined.hmm.mixtures.means[there], own.mixtures.means[index])
    assert combined.hmm.stay("b", 0) == own.stay("b", 0)
    assert np.exp(combined.hmm.bigram.log_probability).sum(axis=1) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize(("kept", "trust"), [(0, 0.4), (9, 0.0), (9, 0.4)])
def test_evidence_is_the_sum_of_both(
    toy_model: Model, trust: float, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "KEPT_FRAMES", kept)
    draw = np.random.default_rng(0)
    own, general = draw.normal(size=(2, 9, 39)).astype(np.float32)
    combined = combine_phones(toy_model.phones)
    log_likelihoods = combined_log_likelihoods(combined, own, trust, general)
    wanted = general_model().log_density(general)[:, combined.columns] + trust * combined.hmm.mixtures.log_likelihood(
        own
    )
    assert log_likelihoods.frames == 9
    assert log_likelihoods.log_density(0, 9, None) == pytest.approx(wanted, abs=2e-3)
    some = np.array([5, 2, 40])
    assert log_likelihoods.log_density(3, 7, some) == pytest.approx(wanted[3:7, some], abs=2e-3)
