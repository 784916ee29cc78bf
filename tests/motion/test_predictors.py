"""Predictors by name: that of docs/extend/predictor.md, in both engines that have predictors, and in their models."""

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.engines import Engine, engine_from_settings, engine_named
from lipmotion.engines.trajectory.model import NETWORK_SHARE
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.extensions import GROUPS
from lipmotion.motion import predictors
from lipmotion.motion.acoustic_network import AcousticNetwork
from lipmotion.motion.articulation import KNOWN_VOICE_SHARE, TABLE_WEIGHT_WITH_PREDICTOR
from lipmotion.motion.posterior_network import PosteriorNetwork
from lipmotion.motion.prior_regression import PriorRegression
from lipmotion.testing import example, examples, speech, timeline
from lipmotion.types import ConditionSpectrum, PriorOutput, TokenPosteriors, silent_monitor

PAGE = Path(__file__).parents[2] / "docs" / "extend" / "predictor.md"
SMALL = {
    "trajectory": {"acoustic_regression": False, "joint_recogniser": False},
    "selection": {"joint_recogniser": False},
}
PREFIX = "predictor.frames."


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[predictors.Predictor]]:
    """The class of the page, as an installed package adds it."""
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
def test_the_predictor_of_the_page_is_trained_stored_and_used(
    name: str, installed: type[predictors.Predictor], monkeypatch: pytest.MonkeyPatch
) -> None:
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
    monkeypatch.setattr(installed, "can_predict", lambda *_: False)
    assert np.abs(chosen.generate(fit.model, spoken).motion.values - wanted).max() > 1e-3


def test_the_trajectory_engine_relies_on_a_predictor_as_far_as_it_is_right(
    installed: type[predictors.Predictor], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = engine("trajectory", "frames").fit(examples(4), silent_monitor).model
    assert plain.network_share == NETWORK_SHARE
    assert plain.motion.prior.contexts is plain.prior.contexts
    assert plain.motion.prior.weight == TABLE_WEIGHT_WITH_PREDICTOR < plain.prior.weight
    assert plain.motion.prior.known_voice_share == KNOWN_VOICE_SHARE < plain.prior.known_voice_share
    fit = installed.fit
    monkeypatch.setattr(
        installed, "fit", lambda training: predictors.PredictorFit(fit(training).predictor, training.values)
    )
    assert engine("trajectory", "frames").fit(examples(4), silent_monitor).model.network_share == pytest.approx(1)


def test_a_model_whose_predictor_is_not_installed_says_so() -> None:
    arrays = {f"{PREFIX}coefficients": np.zeros((40, 2))}
    with pytest.raises(
        ModelFormatError, match=r"^no predictor 'frames'; there are: network, posteriors, prior, encoding; install"
    ):
        predictors.predictor_from_arrays(arrays, 2)
    with pytest.raises(ValueError, match="prior and frames, required one of them"):
        predictors.predictor_from_arrays({**arrays, "prior_sizes": np.zeros(4)}, 2)


def test_a_name_that_is_none_is_refused_before_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("trajectory", "selection"):
        with pytest.raises(InputError, match="no predictor 'frames'; there are: network, posteriors, prior"):
            engine_from_settings(name, settings=["predictor=frames"])
    point = metadata.EntryPoint("frames", "json:dumps", predictors.PREDICTORS.group)
    monkeypatch.setitem(predictors.PREDICTORS.__dict__, "_installed", {"frames": point})
    with pytest.raises(InputError, match="required a class of Predictor of this name"):
        engine_from_settings("trajectory", settings=["predictor=frames"])
    assert predictors.PREDICTORS.group in GROUPS


def test_the_recordings_choose_where_no_name_is_given() -> None:
    one = example(("aa", "t"))
    steps = -(-len(one.valid) // 4)
    prior = PriorOutput(np.zeros((steps, 1)), np.zeros((steps, 0), np.float32), np.zeros(steps))
    standing = replace(one, speech=replace(one.speech, prior=prior))
    heard = replace(
        one,
        valid=np.ones(12_000, bool),
        condition_spectra=(ConditionSpectrum(np.zeros((len(one.valid), 40), np.float16), 1.0, 0.0),),
    )
    much = replace(standing, valid=np.ones(48_000, bool), condition_spectra=heard.condition_spectra)
    assert predictors.choose_predictor(predictors.AUTOMATIC, [one]) is None
    assert predictors.choose_predictor(predictors.AUTOMATIC, [standing]) is PriorRegression
    assert predictors.choose_predictor(predictors.AUTOMATIC, [heard]) is AcousticNetwork
    assert predictors.choose_predictor(predictors.AUTOMATIC, [much]) is AcousticNetwork
    assert predictors.choose_predictor("prior", [heard]) is PriorRegression
    assert predictors.choose_predictor(predictors.AUTOMATIC, [replace(heard, valid=np.ones(11_999, bool))]) is None
    spoken = replace(one, speech=replace(one.speech, posteriors=TokenPosteriors(np.zeros((9, 3), np.float16), "", 1)))
    assert predictors.choose_predictor(predictors.AUTOMATIC, [spoken]) is PosteriorNetwork
    assert predictors.choose_predictor(predictors.AUTOMATIC, [spoken, one]) is None
    assert [predictors.count_conditions(predictors.AUTOMATIC, motion_s, 4) for motion_s in (119.9, 120)] == [1, 4]
    assert predictors.count_conditions(predictors.AUTOMATIC, 1, 0) == 0
    assert [predictors.count_conditions(name, 1, 4) for name in ("network", "posteriors", "prior")] == [0, 1, 4]


def test_a_header_names_the_predictor_only_where_it_was_chosen() -> None:
    assert "predictor" not in engine("trajectory", predictors.AUTOMATIC).config.as_mapping()
    assert engine("selection", "prior").config.as_mapping()["predictor"] == "prior"
