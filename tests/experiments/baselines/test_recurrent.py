from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engines.synthetic import CHANNELS
from engines.synthetic import examples as sentences
from lipmotion.experiments.baselines import recurrent as network
from lipmotion.experiments.baselines.recurrent import Blstm
from lipmotion.experiments.baselines.regression import FrameModel
from lipmotion.types import Example, Progress

pytest.importorskip("torch", reason="the extra 'network' is not installed")


@pytest.fixture(scope="module")
def examples() -> list[Example]:
    """The last frames of each were not seen, and are wrong."""
    made = []
    for one in sentences(12):
        valid = one.valid.copy()
        valid[-8:] = False
        one.motion.values[-8:] = 9
        made.append(replace(one, valid=valid))
    return made


@pytest.fixture(scope="module")
def stages() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def model(examples: list[Example], stages: list[Progress]) -> FrameModel:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network, "EPOCHS", 40)
        patch.setattr(network, "LEAST_STEPS", 1)
        return Blstm().fit(examples, stages.append).model


def test_what_was_taught_comes_back(model: FrameModel) -> None:
    unheard = sentences(14, seed=5)[-1]
    result = Blstm().generate(model, unheard.speech)
    assert result.motion.channels == CHANNELS
    assert result.motion.values.shape == result.variance.shape == unheard.motion.values.shape
    for name in ("opening", "width"):
        assert np.corrcoef(result.motion[name], unheard.motion[name])[0, 1] > 0.8
    assert result.motion["opening"].max() < 1  # not what was not seen


def test_the_same_seed_gives_the_same(examples: list[Example], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network, "EPOCHS", 1)
    monkeypatch.setattr(network, "LEAST_STEPS", 1)
    one, same, other = (Blstm(seed).fit(examples, lambda _: None).model for seed in (0, 0, 1))
    made = [Blstm().generate(each, examples[0].speech).motion.values for each in (one, same, other)]
    assert np.array_equal(made[0], made[1])
    assert not np.allclose(made[0], made[2])


def test_lessons_are_counted(model: FrameModel, stages: list[Progress]) -> None:
    assert model
    assert (stages[0].share, stages[-1].share) == (0, 1)
    assert stages[-1].steps == 40
