from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import CorpusError
from lipmotion.motion import acoustic_network
from lipmotion.motion.acoustic_network import AcousticNetwork
from lipmotion.motion.network_steps import STEP, interpolate_steps
from lipmotion.motion.predictors import Predictor, PredictorTraining
from lipmotion.storage.archive import Checkpoint
from lipmotion.testing import example
from lipmotion.types import SPECTRUM_BANDS, ConditionSpectrum, Example


def example_in_conditions(seed: int, tempos: tuple[float, ...] = (1.0,)) -> tuple[Example, np.ndarray]:
    """An example whose motion is a smooth function of two bands; its other versions are as much distorted as fast."""
    one = example(("aa", "t", "iy", "s"), seed)
    frames = len(one.valid)
    rng = np.random.default_rng(seed)
    slow = np.cumsum(rng.standard_normal((frames, 2)), axis=0)
    slow = (slow - slow.mean(axis=0)) / slow.std(axis=0)
    spectrum = rng.normal(0, 0.1, (frames, SPECTRUM_BANDS))
    spectrum[:, 3], spectrum[:, 8] = slow[:, 0], slow[:, 1]
    versions = []
    for tempo in tempos:
        positions = np.minimum(np.round(np.arange(int(frames / tempo)) * tempo).astype(int), frames - 1)
        versions.append(ConditionSpectrum(spectrum[positions].astype(np.float16), tempo, float(tempo != 1)))
    speech = replace(one.speech, spectrum=spectrum.astype(np.float32))
    return replace(one, speech=speech, condition_spectra=tuple(versions)), slow * [0.1, 0.02] + [0.3, 0.6]


def fit(training: PredictorTraining, steps: int) -> Predictor:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(acoustic_network, "MIN_STEPS", steps)
        patch.setattr(acoustic_network, "BATCH_SIZE", 4)
        return AcousticNetwork.fit(training).predictor


@pytest.fixture(scope="module")
def trained() -> AcousticNetwork:
    """A small network."""
    examples, values = zip(*(example_in_conditions(seed, (1.0, 0.8, 1.25)) for seed in range(6)), strict=True)
    result = fit(PredictorTraining(examples, values, 2), 60)
    assert isinstance(result, AcousticNetwork)
    return result


def test_it_predicts_motion_of_held_out_speech(trained: AcousticNetwork) -> None:
    one, values = example_in_conditions(99)
    motion, distortion = trained.predict(one.speech)
    assert motion.shape == values.shape
    assert distortion.shape == (len(values),)
    for column in range(2):
        assert np.corrcoef(motion[:, column], values[:, column])[0, 1] > 0.7
    assert abs(motion[:, 0].mean() - 0.3) < 0.06


def test_steps_keep_their_values_and_straight_lines_stay_straight_inside() -> None:
    steps = np.random.default_rng(0).standard_normal((6, 2))
    curve = interpolate_steps(steps, 23)
    np.testing.assert_allclose(curve[::STEP], steps, atol=1e-12)
    np.testing.assert_allclose(interpolate_steps(steps, 23, first=2), np.concatenate([steps[[0, 0]], curve[:21]]))
    line, inside = interpolate_steps(np.arange(8.0)[:, None], 29)[:, 0], slice(STEP, -2 * STEP)
    np.testing.assert_allclose(line[inside], np.arange(29)[inside] / STEP, atol=1e-12)


def test_it_is_the_same_after_serialisation_but_for_half_precision(trained: AcousticNetwork) -> None:
    again = AcousticNetwork.from_arrays(trained.arrays(), 2)
    speech = example_in_conditions(5)[0].speech
    np.testing.assert_allclose(again.predict(speech)[0], trained.predict(speech)[0], atol=3e-3)


def test_a_network_without_a_part_or_with_a_scale_of_nothing_is_refused(trained: AcousticNetwork) -> None:
    arrays = trained.arrays()
    for name in ("network_first", "network_layers", "network_biases", "network_output"):
        with pytest.raises(KeyError, match=name):
            AcousticNetwork.from_arrays({other: array for other, array in arrays.items() if other != name}, 2)
    arrays["network_targets"][1, 0] = 0
    with pytest.raises(ValueError, match="scale"):
        AcousticNetwork.from_arrays(arrays, 2)


def test_a_stopped_training_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    """Else more steps would lead elsewhere."""
    examples, values = zip(*(example_in_conditions(seed) for seed in range(2)), strict=True)
    training = PredictorTraining(examples, values, 2, checkpoint=Checkpoint(tmp_path, "job"))
    first, again = fit(training, 2).arrays(), fit(training, 9).arrays()
    np.testing.assert_allclose(again["network_output"], first["network_output"])


def test_examples_without_conditions_are_refused() -> None:
    one, values = example_in_conditions(0)
    with pytest.raises(CorpusError, match="120 s of measured motion"):
        AcousticNetwork.fit(PredictorTraining([replace(one, condition_spectra=())], [values], 2))
