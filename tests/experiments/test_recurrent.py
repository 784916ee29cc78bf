from __future__ import annotations

import numpy as np
import pytest

from lipmotion.testing import CHANNELS
from lipmotion.testing import examples as sentences
from lipmotion.types import Example, Progress
from lipmotion_lab import baselines as network
from lipmotion_lab.baselines import BlstmBaseline, FrameRegressionModel

pytest.importorskip("torch", reason="the extra 'network' is not installed")


@pytest.fixture(scope="module")
def stages() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def model(examples: list[Example], stages: list[Progress]) -> FrameRegressionModel:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(network, "EPOCHS", 40)
        patch.setattr(network, "LEAST_STEPS", 1)
        return BlstmBaseline().fit(examples, stages.append).model


def test_held_out_motion_is_predicted(model):
    held_out = sentences(14, seed=5)[-1]
    result = BlstmBaseline().generate(model, held_out.speech)
    assert result.motion.channels == CHANNELS
    assert result.motion.values.shape == result.variance.shape == held_out.motion.values.shape
    for name in ("opening", "width"):
        assert np.corrcoef(result.motion[name], held_out.motion[name])[0, 1] > 0.8
    assert result.motion["opening"].max() < 1  # values of frames that are not valid are not learned


def test_the_same_seed_gives_the_same(examples, monkeypatch):
    monkeypatch.setattr(network, "EPOCHS", 1)
    monkeypatch.setattr(network, "LEAST_STEPS", 1)
    one, same, other = (BlstmBaseline(seed).fit(examples, lambda _: None).model for seed in (0, 0, 1))
    made = [BlstmBaseline().generate(each, examples[0].speech).motion.values for each in (one, same, other)]
    assert np.array_equal(made[0], made[1])
    assert not np.allclose(made[0], made[2])
