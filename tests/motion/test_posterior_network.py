from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lipmotion import load_model
from lipmotion.errors import CorpusError, InputError
from lipmotion.motion import posterior_network
from lipmotion.motion.acoustic_network import POSTERIOR_SHARES, AcousticNetwork
from lipmotion.motion.network_steps import STEP
from lipmotion.motion.posterior_network import RECURRENT, PosteriorNetwork
from lipmotion.motion.predictors import PredictorTraining, predictor_from_arrays, predictor_to_arrays
from lipmotion.types import Channel, ConditionSpectrum, Example, Features, Motion, Speech, Timeline, TokenPosteriors

TRAINED_RECURRENT = posterior_network._train_recurrent  # the tests of all else train none (``conftest``)
TOKENS, FRAMES, SOURCE = 30, 200, "hama 1.7.0 abc"


def posteriors(number: int, source: str = SOURCE) -> TokenPosteriors:
    """Return posteriors in which one of three tokens is probable for 0.2 s each."""
    rng = np.random.default_rng(number)
    values = rng.normal(-8, 0.5, (FRAMES // 2, TOKENS))
    values[np.arange(len(values)), np.repeat(rng.integers(3, size=FRAMES // 20), 10)] = -0.1
    return TokenPosteriors(values.astype(np.float16), source, 0.95)


def smooth(values: np.ndarray) -> np.ndarray:
    return np.convolve(np.pad(values, 8, mode="edge"), np.full(17, 1 / 17), "valid")


def spectrum(number: int) -> np.ndarray:
    """Return a spectrum whose bands rise and fall together, one time each 0.4 s."""
    loud = np.repeat(np.random.default_rng([1, number]).integers(2, size=FRAMES // 40), 40)
    return np.repeat(loud[:, None] * 2.0 - 1, 40, axis=1).astype(np.float32)


def motion_of(number: int) -> np.ndarray:
    """Return an opening that is wide in the first token, and a width that follows the spectrum."""
    first = np.repeat((posteriors(number).values[:, 0] > -1).astype(float), 2)
    return np.stack([smooth(first), smooth((spectrum(number)[:, 0] + 1) / 2)], axis=1)


def speech(number: int, *, voice: float = 1.0, heard: bool = True) -> Speech:
    features = Features(np.zeros((FRAMES, 39), np.float32), FRAMES / 100)
    sound = spectrum(number) if heard else None
    return Speech(features, Timeline(()), spectrum=sound, voice=voice, posteriors=posteriors(number))


def example(number: int, *, known: bool = True, heard: bool = True) -> Example:
    motion = Motion(motion_of(number), 100.0, (Channel("opening"), Channel("width")))
    clean = (
        (ConditionSpectrum(spectrum(number).astype(np.float16), np.zeros((0, 64), np.float16), 1.0, 0.0),)
        if heard
        else ()
    )
    spoken = speech(number) if known else replace(speech(number), posteriors=None)
    return Example(str(number), replace(spoken, spectrum=None), motion, np.ones(FRAMES, bool), clean)


def trained(examples: list[Example], steps: float = 1.0) -> PosteriorNetwork:
    values = [np.asarray(each.motion.values) for each in examples]
    with pytest.MonkeyPatch.context() as patched:
        less = {"STEPS": 2 * steps, "RECURRENT_STEPS": steps, "_train_recurrent": TRAINED_RECURRENT}
        for name, value in less.items():
            patched.setattr(posterior_network, name, value)
        return PosteriorNetwork.fit(PredictorTraining(examples, values, 2)).predictor  # type: ignore[return-value]


@pytest.fixture(scope="module")
def network() -> PosteriorNetwork:
    return trained([example(number) for number in range(6)], 4.0)


@pytest.fixture(scope="module")
def learned() -> PosteriorNetwork:
    return trained([example(number) for number in range(12)], 8.0)


def likeness(network: PosteriorNetwork, spoken: Speech) -> tuple[float, float]:
    made, wanted = network.predict(spoken)[0], motion_of(99)
    return tuple(float(np.corrcoef(made[:, each], wanted[:, each])[0, 1]) for each in range(2))  # type: ignore[return-value]


@pytest.mark.long
def test_motion_follows_the_posteriors_and_the_spectrum_only_of_a_known_voice(learned: PosteriorNetwork) -> None:
    assert min(likeness(learned, speech(99))) > 0.8
    unknown, unheard = speech(99, voice=0.0), speech(99, heard=False)
    assert learned.predict(unknown)[0] == pytest.approx(learned.predict(unheard)[0])
    opening, width = likeness(learned, unknown)
    assert opening > 0.8
    assert width < 0.5


@pytest.mark.long
def test_the_recurrent_network_counts_for_a_known_voice(learned: PosteriorNetwork) -> None:
    plain = replace(learned, recurrent=None)
    known, unknown = speech(99), speech(99, voice=0.0)
    change = learned.predict(known)[0] - plain.predict(known)[0]
    assert np.abs(change).max() > 0.005
    own, wanted = plain.predict(known)[0] + change / posterior_network.RECURRENT_SHARE, motion_of(99)
    assert all(np.corrcoef(own[:, each], wanted[:, each])[0, 1] > 0.6 for each in range(2))
    assert learned.predict(unknown)[0] == pytest.approx(plain.predict(unknown)[0])


def test_it_is_trained_without_spectra_where_one_is_missing() -> None:
    unheard = trained([example(number, heard=number > 0) for number in range(4)])
    assert unheard.recurrent is None
    assert predictor_to_arrays(unheard).keys() == PosteriorNetwork.ARRAYS.keys() - RECURRENT.specs.keys()
    for heard in (True, False):
        assert np.isfinite(unheard.predict(speech(99, heard=heard))[0]).all()


def test_it_is_stored_and_restored(network: PosteriorNetwork) -> None:
    arrays = predictor_to_arrays(network)
    assert arrays.keys() == PosteriorNetwork.ARRAYS.keys()
    restored = predictor_from_arrays(arrays, 2)
    assert restored.source == SOURCE
    without = {name: values for name, values in arrays.items() if name not in RECURRENT.specs}
    assert predictor_from_arrays(without, 2).recurrent is None
    assert restored.predict(speech(99))[0] == pytest.approx(network.predict(speech(99))[0], abs=0.02)


def test_motion_comes_as_much_later_as_the_speech(network: PosteriorNetwork) -> None:
    spoken, rows = speech(99), posteriors(99)
    cut = replace(spoken.features, values=spoken.features.values[2:])
    later = replace(spoken, features=cut, spectrum=spectrum(99)[2:], posteriors=replace(rows, values=rows.values[1:]))
    whole, shifted = network.predict(spoken)[0], network.predict(later)[0]
    margin = STEP * (network.network.reach + 2)
    inner = slice(margin, FRAMES - 2 - margin)
    assert shifted[inner] == pytest.approx(whole[2:][inner], abs=1e-4)
    assert np.abs(shifted[inner] - whole[inner]).max() > 1e-3
    one = replace(later, posteriors=replace(rows, values=rows.values[:1]), spectrum=spectrum(99)[:2])
    assert np.isfinite(network.predict(one)[0]).all()


def test_posteriors_of_another_version_or_of_none_are_refused(network: PosteriorNetwork) -> None:
    other, none = posteriors(0, "hama 1.8.0 def"), replace(speech(0), posteriors=None)
    with pytest.raises(InputError, match=r"recogniser hama 1\.7\.0 abc, this one is hama 1\.8\.0"):
        network.predict(replace(speech(0), posteriors=other))
    with pytest.raises(InputError, match=r"recogniser hama 1\.7\.0 abc"):
        network.hidden_units(other, 10)
    assert not network.can_predict(none)
    with pytest.raises(InputError, match="no posteriors"):
        network.predict(none)
    with pytest.raises(CorpusError, match="without posteriors"):
        trained([example(0), example(1, known=False)])


@pytest.mark.parametrize(
    ("voice", "mean", "distortion", "share"),
    [(1, 0.95, 0.9, POSTERIOR_SHARES[0]), (1, 0.75, 0.1, 0), (0, 0.75, 0.9, POSTERIOR_SHARES[1]), (0, 0.6, 0.1, 0)],
)
def test_its_share_depends_on_voice_and_recogniser(network, voice, mean, distortion, share):
    shipped = load_model().learned.network
    assert isinstance(shipped, AcousticNetwork)
    dimensions = len(shipped.mean)
    told = shipped.network.output
    constant = told._replace(  # the last output is the distortion
        weights=np.concatenate([told.weights[:, :-1], 0 * told.weights[:, -1:]], axis=1),
        biases=np.append(told.biases[:-1], distortion).astype(np.float32),
    )
    alone = replace(shipped, posterior_network=None, encoding=None, network=replace(shipped.network, output=constant))
    output, ones = network.network.output, np.ones(dimensions)
    weights = np.resize(output.weights, (len(output.weights), dimensions))
    widened = output._replace(weights=weights, biases=np.resize(output.biases, dimensions))
    convolutional = replace(network.network, output=widened)
    beside = replace(network, network=convolutional, centre=0 * ones, scale=ones, recurrent=None)
    heard = np.zeros((FRAMES, 64), np.float16)
    spoken = replace(speech(0, voice=voice), posteriors=replace(posteriors(0), mean=mean), encoding=heard)
    without, same = alone.predict(spoken)
    motion, distortions = replace(alone, posterior_network=beside).predict(spoken)
    assert distortions == pytest.approx(same)
    assert distortions == pytest.approx(np.full(FRAMES, distortion), rel=1e-5)
    wanted = without + share * (beside.predict(spoken)[0] - without)
    np.testing.assert_allclose(motion, wanted, rtol=0, atol=1e-6, equal_nan=False)
    hidden: Any = [each.hidden(spoken) for each in (alone, replace(alone, posterior_network=beside))]
    (plain, sound), (both, same) = hidden
    wanted = np.concatenate([plain, beside.hidden_units(posteriors(0), len(plain))], axis=1)
    np.testing.assert_allclose(both, wanted, rtol=1e-6, equal_nan=False)
    np.testing.assert_allclose(same, sound, rtol=1e-6, equal_nan=False)
