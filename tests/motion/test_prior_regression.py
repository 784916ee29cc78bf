from dataclasses import replace

import numpy as np
import pytest

from lipmotion.motion.network_steps import STEP
from lipmotion.motion.predictors import PredictorFit, PredictorTraining, split_folds
from lipmotion.motion.prior_regression import PriorRegression
from lipmotion.testing import example
from lipmotion.types import SPECTRUM_BANDS, Example, PriorOutput


def standing(seed: int, noise: float = 0.0) -> tuple[Example, np.ndarray]:
    """An example whose motion is that of another model in another range, with noise."""
    one = example(("aa", "t", "iy", "p", "s"), seed)
    frames, rng = len(one.valid), np.random.default_rng(seed)
    motion = one.motion.values[:, :2]
    other = motion[::STEP] * 3 - 1 + rng.normal(0, noise, motion[::STEP].shape)
    hidden = rng.standard_normal((len(other), 4)).astype(np.float32)
    spectrum = rng.standard_normal((frames, SPECTRUM_BANDS)).astype(np.float32)
    prior = PriorOutput(other, hidden, np.full(len(other), 0.25))
    return replace(one, speech=replace(one.speech, spectrum=spectrum, prior=prior)), motion


@pytest.fixture(scope="module")
def fitted() -> PredictorFit:
    """A regression, and its predictions in cross-validation."""
    examples, values = zip(*(standing(seed) for seed in range(4)), strict=True)
    return PriorRegression.fit(PredictorTraining(examples, values, 2))


def test_it_follows_the_other_model_into_another_range(fitted: PredictorFit) -> None:
    one, motion = standing(50)
    found, distortion = fitted.predictor.predict(one.speech)
    assert found.shape == motion.shape
    assert np.corrcoef(found[:, 0], motion[:, 0])[0, 1] > 0.97
    assert np.sqrt(np.mean((found - motion) ** 2)) < 0.03
    assert distortion == pytest.approx(0.25)


@pytest.mark.parametrize("hidden", [0, 2, 7])
def test_regressors_that_are_missing_have_their_mean(fitted: PredictorFit, hidden: int) -> None:
    """As without posteriors, or with a network that has more units: what is left tells the motion."""
    one, motion = standing(50)
    prior = one.speech.prior
    assert prior is not None
    units = np.resize(prior.hidden.T, (hidden, len(prior.hidden))).T
    found, _ = fitted.predictor.predict(replace(one.speech, prior=replace(prior, hidden=units)))
    assert np.corrcoef(found[:, 0], motion[:, 0])[0, 1] > 0.9


def test_predictions_in_cross_validation_are_not_those_of_the_training() -> None:
    examples, values = zip(*(standing(seed, noise=1.0) for seed in range(4)), strict=True)
    regression, predictions = PriorRegression.fit(PredictorTraining(examples, values, 2))
    assert predictions is not None
    held_out = np.mean([(p - x) ** 2 for p, x in zip(predictions, values, strict=True)])
    inside = np.mean([(regression.predict(e.speech)[0] - x) ** 2 for e, x in zip(examples, values, strict=True)])
    assert held_out > inside


def test_a_useless_prior_is_left_out() -> None:
    examples, values = zip(*(standing(seed, noise=100.0) for seed in range(4)), strict=True)
    regression, _ = PriorRegression.fit(PredictorTraining(examples, values, 2))
    one, motion = standing(50, noise=100.0)
    assert np.square(regression.predict(one.speech)[0] - motion).mean() < 1.3 * motion.var(axis=0).mean()


def test_folds_part_all_examples() -> None:
    for count in (1, 2, 5, 9):
        outside = [number for _, out in split_folds(count) for number in out]
        assert sorted(outside) == list(range(count))
    assert all(not set(inside) & set(out) for inside, out in split_folds(5))


def test_it_is_the_same_after_serialisation(fitted: PredictorFit) -> None:
    again = PriorRegression.from_arrays(fitted.predictor.arrays(), 2)
    one, _ = standing(3)
    np.testing.assert_allclose(again.predict(one.speech)[0], fitted.predictor.predict(one.speech)[0], atol=2e-3)


def test_sizes_that_do_not_fit_are_refused(fitted: PredictorFit) -> None:
    arrays = fitted.predictor.arrays()
    arrays["prior_sizes"] = arrays["prior_sizes"] + 1
    with pytest.raises(ValueError, match="prior_sizes"):
        PriorRegression.from_arrays(arrays, 2)
