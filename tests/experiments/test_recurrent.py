from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.testing.examples import CHANNELS
from lipmotion.testing.examples import examples as sentences
from lipmotion.types import Example, TokenPosteriors, silent_monitor
from lipmotion_lab.baselines import BlstmBaseline, FrameRegressionModel


def fitted(examples: list[Example], **options: float) -> FrameRegressionModel:
    return BlstmBaseline(cells=32, **options).fit(examples, silent_monitor).model


@pytest.mark.long
def test_held_out_motion_is_predicted(examples):
    held_out = sentences(14, seed=5)[-1]
    result = BlstmBaseline().generate(fitted(examples, rate=1e-2), held_out.speech)
    assert result.motion.channels == CHANNELS
    assert result.motion.values.shape == result.variance.shape == held_out.motion.values.shape
    for name in ("opening", "width"):
        assert np.corrcoef(result.motion[name], held_out.motion[name])[0, 1] > 0.8
    assert result.motion["opening"].max() < 1  # values of frames that are not valid are not learned


def test_the_same_seed_gives_the_same_and_all_that_is_heard_counts(examples):
    heard = []
    for one in examples[:3]:
        frames, draw = len(one.speech.features.values), np.random.default_rng(0).normal
        said = TokenPosteriors(draw(size=(-(-frames // 2), 200)).astype(np.float16), "a test", 1.0)
        speech = replace(one.speech, posteriors=said, encoding=draw(size=(frames, 64)).astype(np.float16))
        heard.append(replace(one, speech=speech))
    models = [fitted(each, seed=seed, steps=0.1) for seed, each in ((0, heard), (0, heard), (1, heard))]
    made = [BlstmBaseline().generate(each, heard[0].speech).motion.values for each in models]
    assert np.array_equal(made[0], made[1])
    assert not np.allclose(made[0], made[2])
    assert models[0].learned.network.parameters[0].shape[1] == 4 * 39 + 2 * 120 + 64
    deaf = replace(heard[0].speech, encoding=-heard[0].speech.encoding)
    assert not np.allclose(made[0], BlstmBaseline().generate(models[0], deaf).motion.values)
