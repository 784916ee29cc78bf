import numpy as np
import pytest
from scipy import stats

from lipmotion_studio.study.analysis.analyse import power_of, raters_needed, rating_power, share_power
from lipmotion_studio.study.analysis.crossed import Components, crossed_mean

USUAL = Components(0.16, 0.04, 1.0)


def told(components: Components, difference: float, raters: int, sentences: int, studies: int) -> float:
    draw, found = np.random.default_rng(7), 0
    rater, sentence, rest = np.sqrt(components)
    for _ in range(studies):
        values = difference + rest * draw.normal(size=(raters, sentences))
        values += rater * draw.normal(size=(raters, 1)) + sentence * draw.normal(size=(1, sentences))
        found += crossed_mean(values, 4.0).p_value < 0.05
    return found / studies


@pytest.mark.parametrize("components", [USUAL, Components(0, 0, 1.0), Components(0.0, 0.3, 0.5)])
def test_power_is_that_of_simulated_studies(components):
    assert power_of(components, 0.5, 12, 6) == pytest.approx(told(components, 0.5, 12, 6, 800), abs=0.04)


def test_where_raters_alone_differ_power_is_that_of_the_t_test():
    critical, shift = stats.t.ppf(0.975, 15), 0.5 / np.sqrt(0.5 / 16)
    usual = 1 - stats.nct.cdf(critical, 15, shift) + stats.nct.cdf(-critical, 15, shift)
    assert power_of(Components(0.5, 0, 1e-9), 0.5, 16, 6) == pytest.approx(usual, abs=0.01)


def test_the_number_of_raters_is_the_smallest():
    for difference in (0.3, 0.5, 1.0):
        raters = raters_needed(USUAL, difference, 12)
        assert raters is not None
        assert power_of(USUAL, difference, raters, 12) >= 0.8
        assert raters == 2 or power_of(USUAL, difference, raters - 1, 12) < 0.8
    assert raters_needed(USUAL, 0.5, 12, 0.95) > raters_needed(USUAL, 0.5, 12)  # type: ignore[operator]


def test_sentences_that_differ_bound_what_raters_can_tell():
    components = Components(0.1, 0.3, 0.5)
    assert raters_needed(components, 0.3, 6) is None
    assert raters_needed(components, 0.3, 60) is not None


def test_judgements_that_never_vary():
    nothing = Components(0, 0, 0)
    assert power_of(nothing, 0.1, 2, 2) == 1
    assert power_of(nothing, 0.0, 2, 2) == pytest.approx(0.05)
    assert raters_needed(nothing, 0.1, 2) == 2


def test_tables_of_raters():
    rows = rating_power(USUAL, "mos", 12, 0.8)
    assert [row["difference"] for row in rows] == [0.1, 0.2, 0.3, 0.5, 1.0]
    assert [row["difference"] for row in rating_power(USUAL, "ranking", 12, 0.8)] == [2, 5, 10, 20]
    shares = share_power(Components(0.05, 0.02, 0.6), 12, 0.8)
    assert [row["share"] for row in shares] == [0.55, 0.6, 0.65, 0.7, 0.75]
    needed = [row["raters"] for row in shares if row["raters"]]
    assert needed == sorted(needed, reverse=True)
    assert rating_power(None, "mos", 12, 0.8) == share_power(None, 12, 0.8) == rating_power(USUAL, "mos", 1, 0.8) == []
