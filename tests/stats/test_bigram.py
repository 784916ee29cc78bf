from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.stats.bigram import DISCOUNT, estimate_bigram

UNITS = ("sil", "a", "b", "c", "d")
SENTENCES = st.lists(st.lists(st.sampled_from(UNITS), max_size=8), max_size=6)


@given(sentences=SENTENCES)
def test_rows_are_distributions(sentences):
    probability = np.exp(estimate_bigram(UNITS, sentences).log_probability)
    assert probability.sum(axis=1) == pytest.approx(np.ones(len(UNITS)), abs=1e-5)
    assert (probability > 0).all()


@given(sentences=SENTENCES)
def test_unseen_pairs_share_in_proportion_to_unigrams(sentences):
    bigram = estimate_bigram(UNITS, sentences)
    said = [unit for sentence in sentences for unit in sentence]
    seen = {pair for sentence in sentences for pair in pairwise(sentence)}
    for unit in UNITS:
        ratios = [
            bigram(unit, following) - np.log(said.count(following) or 0.5)
            for following in UNITS
            if (unit, following) not in seen
        ]
        assert ratios == pytest.approx(ratios[:1] * len(ratios), abs=1e-4)


@given(sentences=SENTENCES)
def test_order_of_units_changes_nothing(sentences):
    straight, back = estimate_bigram(UNITS, sentences), estimate_bigram(UNITS[::-1], sentences)
    for unit in UNITS:
        for following in UNITS:
            assert straight(unit, following) == pytest.approx(back(unit, following), abs=1e-5)


def test_discounted_counts():
    bigram = estimate_bigram(UNITS, [["a", "b", "a", "b"], ["a", "c"]])
    assert bigram("a", "b") == pytest.approx(np.log((2 - DISCOUNT) / 3), abs=1e-6)
    assert bigram("a", "c") == pytest.approx(np.log((1 - DISCOUNT) / 3), abs=1e-6)
    left = 2 * DISCOUNT / 3  # shared by sil, a and d with unigram counts ½, 3 and ½
    assert bigram("a", "a") == pytest.approx(np.log(left * 3 / 4), abs=1e-6)
    assert bigram("a", "d") == pytest.approx(np.log(left * 0.5 / 4), abs=1e-6)


def test_seen_pairs_beat_unseen_ones_of_the_same_frequency():
    bigram = estimate_bigram(UNITS, [["a", "b", "a", "b", "a", "b"], ["sil", "c"], ["sil", "c"], ["sil", "c"]])
    assert bigram("a", "b") > bigram("a", "c")
    assert bigram("sil", "c") > bigram("sil", "b")


def test_without_data_units_are_equally_likely():
    assert np.exp(estimate_bigram(UNITS, []).log_probability) == pytest.approx(np.full((5, 5), 0.2))
