from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.stats import em
from lipmotion.stats.bigram import DISCOUNT, estimate_bigram
from lipmotion.stats.em import run_em, sum_statistics
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint


@dataclass(frozen=True)
class Half:
    """The statistics of a model that every step moves half way to 1; minus the distance is its log likelihood."""

    model: float

    @property
    def mean_log_likelihood(self) -> float:
        return self.model - 1


def maximise(model: float, statistics: Half) -> float:
    assert statistics.model == model
    return (model + 1) / 2


def test_all_steps_are_taken_and_reported():
    log = []
    result = run_em(0.0, Half, maximise, 3, lambda *step: log.append(step))
    assert result.model == 0.875
    assert result.statistics == Half(0.75)
    assert not result.converged
    assert result.log_likelihoods == (-1, -0.5, -0.25)
    assert log == [(1, 0.5, Half(0.0)), (2, 0.75, Half(0.5)), (3, 0.875, Half(0.75))]


@pytest.mark.parametrize(("converged", "model", "reported"), [(True, 0.875, 3), (False, 0.75, 2)])
def test_it_stops_at_the_first_step_that_gains_too_little(converged, model, reported):
    log = []
    result = run_em(0.0, Half, maximise, 20, lambda *step: log.append(step), min_gain=0.3, maximise_converged=converged)
    assert result.model == model
    assert result.log_likelihoods == (-1, -0.5, -0.25)
    assert len(log) == reported
    assert result.converged


def test_the_first_step_never_counts_as_converged():
    assert run_em(1.0, Half, maximise, 5, min_gain=np.inf).log_likelihoods == (0, 0)


SHARDS = list(np.random.default_rng(0).normal(0, 1e3, (9, 50)))


def expect(job: tuple[float, np.ndarray]) -> dict[str, np.ndarray]:
    model, shard = job
    return {"sum": np.array((model * shard).sum()), "squares": np.square(shard)}


def test_statistics_are_summed_over_shards_and_found_again_after_a_stop(tmp_path, monkeypatch):
    """Those of another model or of other data are not."""
    monkeypatch.setattr(em, "SAVE_S", 0.0)
    computed = []

    def count(function, jobs):
        for job in jobs:
            computed.append(job)
            if len(computed) == 5:
                raise KeyboardInterrupt
            yield function(job)

    work = Checkpoint(tmp_path, "job", count)
    with pytest.raises(KeyboardInterrupt):
        sum_statistics(expect, 2.0, SHARDS, work)
    whole = sum_statistics(expect, 2.0, SHARDS, NO_CHECKPOINT)
    assert whole["sum"] == pytest.approx(2 * np.sum(SHARDS))
    assert whole["squares"] == pytest.approx(np.square(SHARDS).sum(axis=0))
    for model, shards, more in ((2.0, SHARDS, 5), (2.0, SHARDS, 0), (3.0, SHARDS, 9), (2.0, SHARDS[::-1], 9)):
        before = len(computed)
        found = sum_statistics(expect, model, shards, work)
        assert len(computed) - before == more
        assert np.array_equal(found["squares"], sum_statistics(expect, model, shards, NO_CHECKPOINT)["squares"])
    assert sum_statistics(expect, 2.0, [], NO_CHECKPOINT) == {}


UNITS = ("sil", "a", "b", "c", "d")
SENTENCES = st.lists(st.lists(st.sampled_from(UNITS), max_size=8), max_size=6)


@given(sentences=SENTENCES)
@settings(max_examples=25)
def test_rows_are_distributions(sentences):
    probability = np.exp(estimate_bigram(UNITS, sentences).log_probability)
    assert probability.sum(axis=1) == pytest.approx(np.ones(len(UNITS)), abs=1e-5)
    assert (probability > 0).all()


@given(sentences=SENTENCES)
@settings(max_examples=25)
def test_unseen_pairs_share_in_proportion_to_unigrams(sentences):
    bigram = estimate_bigram(UNITS, sentences)
    said = [unit for sentence in sentences for unit in sentence]
    seen = {pair for sentence in sentences for pair in pairwise(sentence)}
    for unit in UNITS:
        unseen = [following for following in UNITS if (unit, following) not in seen]
        ratios = [bigram(unit, following) - np.log(said.count(following) or 0.5) for following in unseen]
        assert ratios == pytest.approx(ratios[:1] * len(ratios), abs=1e-4)


def test_discounted_counts():
    bigram = estimate_bigram(UNITS, [["a", "b", "a", "b"], ["a", "c"]])
    left = 2 * DISCOUNT / 3  # shared by sil, a and d with unigram counts ½, 3 and ½
    wanted = {"b": (2 - DISCOUNT) / 3, "c": (1 - DISCOUNT) / 3, "a": left * 3 / 4, "d": left * 0.5 / 4}
    for following, share in wanted.items():
        assert bigram("a", following) == pytest.approx(np.log(share), abs=1e-6)
