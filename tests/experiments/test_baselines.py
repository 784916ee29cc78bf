from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import CorpusError
from lipmotion.testing import CHANNELS
from lipmotion.types import Example, silent_monitor
from lipmotion_lab.baselines import REACH, ContextRidge, MeanPose

BASELINES: list[type] = [MeanPose, ContextRidge]


def valid_motion(examples: list[Example]) -> np.ndarray:
    return np.concatenate([one.motion.values[one.valid] for one in examples])


def test_motion_has_a_row_for_every_feature_frame(examples):
    for baseline in BASELINES:
        engine = baseline()
        fit = engine.fit(examples, silent_monitor)
        result = engine.generate(fit.model, examples[0].speech)
        frames = len(examples[0].speech.features.values)
        assert fit.figures == {"frames": len(valid_motion(examples))}
        assert (result.motion.rate_hz, result.motion.channels) == (100, CHANNELS)
        assert result.motion.values.shape == result.variance.shape == (frames, len(CHANNELS))
        assert np.isfinite(result.motion.values).all()
        assert (result.variance >= 0).all()
        assert len(result.trace.frames) == frames
    unseen = [replace(one, valid=np.zeros_like(one.valid)) for one in examples]
    with pytest.raises(CorpusError, match="none of 12 examples has motion"):
        MeanPose().fit(unseen, silent_monitor)


def test_the_mean_pose(examples):
    model = MeanPose().fit(examples, silent_monitor).model
    made = MeanPose().generate(model, examples[0].speech)
    assert made.motion.values == pytest.approx(
        np.broadcast_to(valid_motion(examples).mean(axis=0), made.motion.values.shape)
    )
    direct = made.motion.column("opening")
    assert made.variance[0, direct] == pytest.approx(valid_motion(examples)[:, direct].var())


def with_delayed_opening(examples: list[Example], curve: np.ndarray, late: int) -> list[Example]:
    """Return the examples with an opening that is twice a column of the features, ``late`` frames later."""
    made = []
    for one in examples:
        values = one.motion.values.copy()
        values[:, one.motion.column("opening")] = 3 + 2 * np.roll(one.speech.features.values @ curve, late)
        made.append(replace(one, motion=replace(one.motion, values=values)))
    return made


def error(engine, examples: list[Example]) -> float:
    model = engine.fit(examples, silent_monitor).model
    made = engine.generate(model, examples[0].speech).motion["opening"]
    inner = slice(2 * REACH, -2 * REACH)
    return float(np.abs(made - examples[0].motion["opening"])[inner].max())


def test_the_reach_of_the_acoustic_context(examples):
    column = np.eye(39)[3]
    assert error(ContextRidge(), with_delayed_opening(examples[:6], column, REACH)) < 0.2
    assert error(ContextRidge(), with_delayed_opening(examples[:6], column, REACH + 8)) > 1
