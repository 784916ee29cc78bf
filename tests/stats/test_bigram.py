from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.stats.bigram import DISCOUNT, estimate_bigram

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
