from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.motion import posterior_network
from lipmotion.motion.acoustic_network import POSTERIOR_SHARES, AcousticNetwork
from lipmotion.motion.posterior_network import (
    POSTERIOR_ARRAYS,
    PosteriorNetwork,
    fit_posterior_network,
    posterior_network_from_arrays,
)
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.pipeline.model import load_model
from lipmotion.types import Channel, Example, Features, Motion, Speech, Timeline, TokenPosteriors

TOKENS, FRAMES, SOURCE = 30, 200, "hama 1.7.0 abc"


def posteriors(number: int, source: str = SOURCE) -> TokenPosteriors:
    """Return posteriors in which one of three tokens is probable for 0.2 s each."""
    rng = np.random.default_rng(number)
    values = rng.normal(-8, 0.5, (FRAMES // 2, TOKENS))
    said = np.repeat(rng.integers(3, size=FRAMES // 20), 10)
    values[np.arange(len(values)), said] = -0.1
    return TokenPosteriors(values.astype(np.float16), source, 0.95)


def motion_of(found: TokenPosteriors) -> np.ndarray:
    """Return an opening that is wide in the first token, and a width that is the other way round."""
    opening = np.repeat((found.values[:, 0] > -1).astype(float), 2)
    smooth = np.convolve(np.pad(opening, 8, mode="edge"), np.full(17, 1 / 17), "valid")
    return np.stack([smooth, 1 - smooth], axis=1)


def example(number: int, *, known: bool = True) -> Example:
    found = posteriors(number)
    speech = Speech(Features(np.zeros((FRAMES, 39), np.float32), FRAMES / 100), Timeline(()))
    motion = Motion(motion_of(found), 100.0, (Channel("opening"), Channel("width")))
    return Example(str(number), replace(speech, posteriors=found if known else None), motion, np.ones(FRAMES, bool))


@pytest.fixture(scope="module")
def network() -> PosteriorNetwork:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(posterior_network, "PLAN", replace(posterior_network.PLAN, steps=30))
        fitted = trained([example(number) for number in range(8)])
    assert fitted is not None
    return fitted


def trained(examples: list[Example]) -> PosteriorNetwork | None:
    values = [np.asarray(each.motion.values) for each in examples]
    return fit_posterior_network(PredictorTraining(examples, values, 2), np.full(2, 0.5), np.full(2, 0.4))


def test_motion_follows_the_posteriors(network: PosteriorNetwork) -> None:
    new = posteriors(99)
    assert np.corrcoef(network.predict(new, FRAMES)[:, 0], motion_of(new)[:, 0])[0, 1] > 0.8


def test_it_is_stored_and_restored(network: PosteriorNetwork) -> None:
    arrays = network.arrays()
    assert arrays.keys() == POSTERIOR_ARRAYS.keys()
    restored = posterior_network_from_arrays(arrays, 2)
    assert restored is not None
    assert restored.source == SOURCE
    assert restored.predict(posteriors(99), FRAMES) == pytest.approx(network.predict(posteriors(99), FRAMES), abs=0.02)
    assert posterior_network_from_arrays({}, 2) is None


def test_posteriors_of_another_version_are_refused(network: PosteriorNetwork) -> None:
    with pytest.raises(InputError, match=r"recogniser hama 1\.7\.0 abc, this one is hama 1\.8\.0"):
        network.predict(posteriors(0, "hama 1.8.0 def"), FRAMES)
    with pytest.raises(InputError, match=r"recogniser hama 1\.7\.0 abc"):
        network.hidden(posteriors(0, "hama 1.8.0 def"), 10)


def test_without_posteriors_of_all_there_is_none() -> None:
    assert trained([example(0), example(1, known=False)]) is None


@pytest.mark.parametrize(("voice", "mean", "share"), [(1, 0.95, POSTERIOR_SHARES[0]), (0, 0.95, 1), (0, 0.5, 0)])
def test_its_share_depends_on_the_voice_and_on_how_sure_the_recogniser_is(
    network: PosteriorNetwork, voice: float, mean: float, share: float
) -> None:
    shipped = load_model().learned.network
    assert isinstance(shipped, AcousticNetwork)
    alone, dimensions = replace(shipped, beside=None), len(shipped.mean)
    output, ones = network.network.output, np.ones(dimensions)
    weights = np.resize(output.weights, (len(output.weights), dimensions))
    widened = output._replace(weights=weights, biases=np.resize(output.biases, dimensions))
    beside = replace(network, network=replace(network.network, output=widened), centre=0 * ones, scale=ones)
    spectrum = np.random.default_rng(0).normal(size=(FRAMES, 40)).astype(np.float32)
    found = replace(posteriors(0), mean=mean)
    features = Features(np.zeros((FRAMES, 39), np.float32), FRAMES / 100)
    speech = Speech(features, Timeline(()), spectrum=spectrum, voice=voice, posteriors=found)
    without, distortion = alone.predict(speech)
    motion, same = replace(alone, beside=beside).predict(speech)
    assert motion == pytest.approx(without + share * (beside.predict(found, FRAMES) - without), abs=1e-6)
    assert same == pytest.approx(distortion)
    plain, both = alone.hidden(speech), replace(alone, beside=beside).hidden(speech)
    assert plain is not None
    assert both is not None
    np.testing.assert_array_equal(both[0][:, : plain[0].shape[1]], plain[0])
    np.testing.assert_array_equal(both[0][:, plain[0].shape[1] :], beside.hidden(found, len(plain[0])))
    assert both[1] == pytest.approx(plain[1])
