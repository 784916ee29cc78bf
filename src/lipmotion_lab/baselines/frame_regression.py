"""Baselines that regress motion on acoustic features frame by frame, without a model of phones."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Animator, Fit
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.speech.features.mfcc import LOG_ENERGY
from lipmotion.stats.trees import ridge, zero_statistics
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import FRAME_RATE_HZ, Constraints, Example, Generation, Monitor, Motion, Speech, StateTrace

Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
COMPONENTS = 16
"""Dimensions that all point channels are reduced to, as in the engines."""
SMOOTHING = 9
"""Frames that the log energy is averaged over: 90 ms, a little more than two pictures of a video."""
REACH = 15
"""Frames of acoustic context on both sides: ±150 ms."""
RIDGE_FRAMES = 1e-3
"""Strength of the ridge penalty, in frames of training."""


@dataclass(frozen=True, eq=False)
class FrameRegressionModel:
    """A map from the acoustic features of a frame and its neighbours to motion.

    space    : reduced space of the motion
    learned  : coefficients [shape=(F, Q)], or another representation that the baseline has trained
    variance : mean squared error in the reduced space [shape=(Q,)]
    """

    space: MotionSpace
    learned: Any
    variance: Array


class Baseline(Animator[FrameRegressionModel]):
    """Predicts reduced motion from acoustic features, without phones."""

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NO_CHECKPOINT,  # noqa: ARG002 - it takes seconds
    ) -> Fit[FrameRegressionModel]:
        space, values = fit_reduced_motion(examples, COMPONENTS)
        features = [np.asarray(example.speech.features.values) for example in examples]
        valid = [np.asarray(example.valid) for example in examples]
        learned = self.fit_map(features, values, valid, monitor)
        errors = [np.square(self.predict(learned, f) - x)[v] for f, x, v in zip(features, values, valid, strict=True)]
        model = FrameRegressionModel(space, learned, np.concatenate(errors).mean(axis=0))
        return Fit(model, {"frames": sum(int(mask.sum()) for mask in valid)})

    def generate(  # noqa: D102
        self,
        model: FrameRegressionModel,
        speech: Speech,
        constraints: Constraints | None = None,  # noqa: ARG002 - compared, never edited
    ) -> Generation:
        predicted = self.predict(model.learned, np.asarray(speech.features.values))
        values, variance = model.space.restore(predicted, np.broadcast_to(model.variance, predicted.shape))
        motion = Motion(values, FRAME_RATE_HZ, model.space.channels)
        return Generation(motion, variance, speech.units, StateTrace(("all",), np.zeros(len(values), np.intp)))

    @abstractmethod
    def fit_map(
        self,
        features: Sequence[Float32Array],
        values: Sequence[Array],
        valid: Sequence[NDArray[np.bool_]],
        monitor: Monitor,
    ) -> Any:
        """Return a map from features [each shape=(T, 39)] to reduced motion [each shape=(T, Q)].

        valid : frames whose motion was observed [each shape=(T,)]
        """

    @abstractmethod
    def predict(self, learned: Any, features: Float32Array) -> Array:
        """Return the reduced motion [shape=(T, Q)] of features [shape=(T, 39)]."""


class LinearBaseline(Baseline):
    """Ridge regression of motion on the ``regressors`` of each frame."""

    strength: ClassVar[float] = 0.0

    @abstractmethod
    def regressors(self, features: Float32Array) -> Array:
        """Return the regressors of each frame [shape=(T, F)]."""

    def fit_map(  # noqa: D102
        self,
        features: Sequence[Float32Array],
        values: Sequence[Array],
        valid: Sequence[NDArray[np.bool_]],
        monitor: Monitor,  # noqa: ARG002 - it takes seconds
    ) -> Array:
        statistics, frames = None, 0
        for inputs, targets, mask in zip(features, values, valid, strict=True):
            rows = self.regressors(inputs)[mask]
            statistics = statistics or zero_statistics(rows.shape[1], targets.shape[1])
            statistics.add(rows, targets[mask])
            frames += len(rows)
        if statistics is None:
            return np.zeros((0, 0))
        return ridge(statistics, np.zeros_like(statistics.targets), self.strength * frames)

    def predict(self, learned: Array, features: Float32Array) -> Array:  # noqa: D102
        return self.regressors(features) @ learned


@final
class MeanPose(LinearBaseline):
    """The mean of all training frames, for every frame."""

    def regressors(self, features: Float32Array) -> Array:  # noqa: D102
        return np.ones((len(features), 1))


@final
class LoudnessRegression(LinearBaseline):
    """Linear regression on the smoothed log energy."""

    def regressors(self, features: Float32Array) -> Array:  # noqa: D102
        padded = np.pad(features[:, LOG_ENERGY].astype(float), SMOOTHING // 2, "edge")
        smooth = np.convolve(padded, np.full(SMOOTHING, 1 / SMOOTHING), "valid")
        return np.stack([smooth, np.ones(len(smooth))], axis=1)


@final
class ContextRidge(LinearBaseline):
    """Ridge regression on the features of all frames within ±150 ms."""

    strength = RIDGE_FRAMES

    def regressors(self, features: Float32Array) -> Array:  # noqa: D102
        frames = np.clip(np.arange(len(features))[:, None] + np.arange(-REACH, REACH + 1), 0, len(features) - 1)
        rows = features[frames].reshape(len(features), -1)
        return np.concatenate([rows, np.ones((len(rows), 1), rows.dtype)], axis=1).astype(float)
