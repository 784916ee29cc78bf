"""Predictors by name: that of docs/extend/predictor.md, in both engines that have predictors, and in their models."""

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.engines import Engine, create_engine, engine_named
from lipmotion.engines.trajectory.model import NETWORK_SHARE
from lipmotion.errors import CorpusError, InputError, ModelFormatError
from lipmotion.extensions import GROUPS
from lipmotion.motion import acoustic_network, predictors
from lipmotion.motion.acoustic_network import AcousticNetwork
from lipmotion.motion.articulation import KNOWN_VOICE_SHARE, TABLE_WEIGHT_WITH_PREDICTOR
from lipmotion.motion.network_steps import STEP, interpolate_steps
from lipmotion.motion.posterior_network import PosteriorNetwork
from lipmotion.motion.predictors import Predictor, PredictorFit, PredictorTraining, split_folds
from lipmotion.motion.prior_regression import PriorRegression
from lipmotion.storage.archive import Checkpoint
from lipmotion.testing import example, examples, speech, timeline
from lipmotion.types import SPECTRUM_BANDS, ConditionSpectrum, Example, PriorOutput, TokenPosteriors, silent_monitor

PAGE = Path(__file__).parents[2] / "docs" / "extend" / "predictor.md"
ALONE = {"joint_recogniser": False}
SMALL = {"trajectory": {"acoustic_regression": False, **ALONE}, "selection": ALONE}
PREFIX = "predictor.frames."


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[predictors.Predictor]]:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "predictor_of_the_page.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    point = metadata.EntryPoint("frames", "predictor_of_the_page:FrameRegression", predictors.PREDICTORS.group)
    monkeypatch.setitem(predictors.PREDICTORS.__dict__, "_installed", {"frames": point})
    yield predictors.PREDICTORS.load("frames")
    del sys.modules["predictor_of_the_page"]


def engine(name: str, predictor: str) -> Engine[Any]:
    return engine_named(name, SMALL[name] | {"predictor": predictor})


@pytest.mark.parametrize("name", ["trajectory", "selection"])
def test_the_predictor_of_the_page_is_trained_stored_and_used(name: str, installed: type[predictors.Predictor]) -> None:
    chosen, spoken = engine(name, "frames"), speech(timeline(("p", "aa", "m", "iy")))
    fit = chosen.fit(examples(4), silent_monitor)
    assert not fit.uses_prior
    used = fit.model.network if name == "trajectory" else fit.model.guide.predictor
    assert type(used) is installed
    arrays = chosen.to_arrays(fit.model)
    assert {array for array in arrays if array.startswith("predictor")} == {PREFIX + each for each in installed.ARRAYS}
    restored = chosen.from_arrays(arrays)
    wanted = chosen.generate(fit.model, spoken).motion.values
    assert chosen.generate(restored, spoken).motion.values == pytest.approx(wanted, abs=2e-3)
    with pytest.raises(ModelFormatError, match="undeclared 'other'"):
        chosen.from_arrays(arrays | {f"{PREFIX}other": np.zeros(3)})
    with pytest.raises(ModelFormatError, match="coefficients is missing"):
        chosen.from_arrays({array: values for array, values in arrays.items() if array != f"{PREFIX}coefficients"})
    without = replace(fit.model, **{"network" if name == "trajectory" else "guide": None})
    assert np.abs(chosen.generate(without, spoken).motion.values - wanted).max() > 1e-3


@pytest.mark.usefixtures("installed")
def test_the_trajectory_engine_relies_on_a_predictor_more_than_on_the_table() -> None:
    plain = engine("trajectory", "frames").fit(examples(4), silent_monitor).model
    assert plain.network_share == NETWORK_SHARE
    assert plain.motion.prior.contexts is plain.prior.contexts
    assert plain.motion.prior.weight == TABLE_WEIGHT_WITH_PREDICTOR < plain.prior.weight
    assert plain.motion.prior.known_voice_share == KNOWN_VOICE_SHARE < plain.prior.known_voice_share


def test_a_model_whose_predictor_is_not_installed_says_so() -> None:
    arrays = {f"{PREFIX}coefficients": np.zeros((40, 2))}
    known = "network, posteriors, prior, encoding"
    with pytest.raises(ModelFormatError, match=rf"^no predictor 'frames'; there are: {known}; install"):
        predictors.predictor_from_arrays(arrays, 2)
    with pytest.raises(ValueError, match="prior and frames, required one of them"):
        predictors.predictor_from_arrays({**arrays, "prior_sizes": np.zeros(4)}, 2)


def test_a_name_that_is_none_is_refused_before_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("trajectory", "selection"):
        with pytest.raises(InputError, match="no predictor 'frames'; there are: network, posteriors, prior"):
            create_engine(name, settings=["predictor=frames"])
    point = metadata.EntryPoint("frames", "json:dumps", predictors.PREDICTORS.group)
    monkeypatch.setitem(predictors.PREDICTORS.__dict__, "_installed", {"frames": point})
    with pytest.raises(InputError, match="required a class of Predictor of this name"):
        create_engine("trajectory", settings=["predictor=frames"])
    assert predictors.PREDICTORS.group in GROUPS


def test_the_recordings_choose_where_no_name_is_given() -> None:
    one = example(("aa", "t"))
    steps = -(-len(one.valid) // 4)
    prior = PriorOutput(np.zeros((steps, 1)), np.zeros((steps, 0), np.float32), np.zeros(steps))
    standing = replace(one, speech=replace(one.speech, prior=prior))
    spectra = (ConditionSpectrum(none := np.zeros((0, 64), np.float16), none, 1.0, 0.0),)
    heard = replace(one, valid=np.ones(12_000, bool), condition_spectra=spectra)
    much = replace(standing, valid=np.ones(48_000, bool), condition_spectra=spectra)
    spoken = replace(one, speech=replace(one.speech, posteriors=TokenPosteriors(np.zeros((9, 3), np.float16), "", 1)))
    choose = partial(predictors.choose_predictor, predictors.AUTOMATIC)
    assert choose([one]) is None
    assert choose([standing]) is PriorRegression
    assert choose([heard]) is choose([much]) is AcousticNetwork
    assert choose([replace(heard, valid=np.ones(11_999, bool))]) is None
    assert choose([spoken]) is PosteriorNetwork
    assert choose([spoken, one]) is None
    assert predictors.choose_predictor("prior", [heard]) is PriorRegression
    assert [predictors.count_conditions(predictors.AUTOMATIC, motion_s, 4) for motion_s in (119.9, 120)] == [1, 4]
    assert predictors.count_conditions(predictors.AUTOMATIC, 1, 0) == 0
    assert [predictors.count_conditions(name, 1, 4) for name in ("network", "posteriors", "prior")] == [0, 1, 4]


def test_a_header_names_the_predictor_only_where_it_was_chosen() -> None:
    assert "predictor" not in engine("trajectory", predictors.AUTOMATIC).config.as_mapping()
    assert engine("selection", "prior").config.as_mapping()["predictor"] == "prior"


def example_in_conditions(seed: int, tempos: tuple[float, ...] = (1.0,)) -> tuple[Example, np.ndarray]:
    """An example whose motion is in a band and in the encoding; its other versions are as much distorted as fast."""
    one = example(("aa", "t", "iy", "s"), seed)
    frames = len(one.valid)
    rng = np.random.default_rng(seed)
    slow = np.cumsum(rng.standard_normal((frames, 2)), axis=0)
    slow = (slow - slow.mean(axis=0)) / slow.std(axis=0)
    spectrum = rng.normal(0, 0.1, (frames, SPECTRUM_BANDS))
    encoding, versions = rng.normal(0, 0.1, (frames, 64)).astype(np.float16), []
    spectrum[:, 3], encoding[:, 8] = slow[:, 0], slow[:, 1] / 4
    for tempo in tempos:
        positions = np.minimum(np.round(np.arange(int(frames / tempo)) * tempo).astype(int), frames - 1)
        heard = spectrum[positions].astype(np.float16), encoding[positions]
        versions.append(ConditionSpectrum(*heard, tempo, float(tempo != 1)))
    speech = replace(one.speech, spectrum=spectrum.astype(np.float32), encoding=encoding)
    return replace(one, speech=speech, condition_spectra=tuple(versions)), slow * [0.1, 0.02] + [0.3, 0.6]


def fit(training: PredictorTraining, steps: int) -> Predictor:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(acoustic_network, "MIN_STEPS", steps)
        patch.setattr(acoustic_network, "BATCH_SIZE", 4)
        return AcousticNetwork.fit(training).predictor


@pytest.fixture(scope="module")
def trained() -> AcousticNetwork:
    examples, values = zip(*(example_in_conditions(seed, (1.0, 0.8, 1.25)) for seed in range(6)), strict=True)
    return fit(PredictorTraining(examples, values, 2), 60)  # type: ignore[return-value]


@pytest.mark.long
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


@pytest.mark.parametrize("kind", ["trained", "fitted"])
def test_a_predictor_is_the_same_after_serialisation_but_for_half_precision(kind: str, request: Any) -> None:
    learned = request.getfixturevalue(kind)
    learned, one = (learned, example_in_conditions(5)[0]) if kind == "trained" else (learned.predictor, standing(3)[0])
    again = type(learned).from_arrays(learned.arrays(), 2)
    np.testing.assert_allclose(again.predict(one.speech)[0], learned.predict(one.speech)[0], atol=3e-3)


def test_a_network_of_a_former_model_hears_the_spectrum_alone(trained: AcousticNetwork) -> None:
    speech = replace(example_in_conditions(5)[0].speech, encoding=None)
    former = replace(trained, network=acoustic_network.FORMER_SHAPE.initial(3, 0), encoding=None)
    again = AcousticNetwork.from_arrays(former.arrays(), 2)
    np.testing.assert_allclose(again.predict(speech)[0], former.predict(speech)[0], atol=3e-3)
    with pytest.raises(InputError, match="encoding"):
        trained.predict(speech)


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
    prior: Any = one.speech.prior
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


def test_folds_part_all_examples() -> None:
    for count in (1, 2, 5, 9):
        assert sorted([number for _, out in split_folds(count) for number in out]) == list(range(count))
    assert all(not set(inside) & set(out) for inside, out in split_folds(5))


def test_sizes_that_do_not_fit_are_refused(fitted: PredictorFit) -> None:
    arrays = fitted.predictor.arrays()
    arrays["prior_sizes"] = arrays["prior_sizes"] + 1
    with pytest.raises(ValueError, match="prior_sizes"):
        PriorRegression.from_arrays(arrays, 2)
