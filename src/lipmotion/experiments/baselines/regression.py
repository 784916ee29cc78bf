"""What needs no model of phones: yardsticks for those that have one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import Animator, Fit
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.speech.mfcc import LOG_ENERGY
from lipmotion.stats.regression import ridge, zero_statistics
from lipmotion.storage.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.types import (
    FRAME_RATE_HZ,
    Constraints,
    Example,
    Generation,
    Monitor,
    Motion,
    Speech,
    Trace,
)

Array = NDArray[np.float64]
Single = NDArray[np.float32]
COMPONENTS = 16
"""Dimensions that all point channels are reduced to, as in the engines."""
SMOOTHING = 9
"""Frames that the log energy is averaged over: 90 ms, a little more than two pictures of a video."""
REACH = 15
"""Frames of sound to both sides: ±150 ms."""
STRENGTH = 1e-3
"""Of the ridge, in frames of training."""


@dataclass(frozen=True, eq=False)
class FrameModel:
    """A frame's motion from what is heard around it.

    space  : of the motion
    map    : what the baseline learned: coefficients [shape=(F, Q)], or anything of its own
    spread : mean squared error in the space [shape=(Q,)]
    """

    space: MotionSpace
    map: Any
    spread: Array


class Baseline(Animator[FrameModel]):
    """Learns the dimensions of motion from features, without phones."""

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NOTHING_KEPT,  # noqa: ARG002 - it takes seconds
    ) -> Fit[FrameModel]:
        space, values = fit_reduced_motion(examples, COMPONENTS)
        features = [np.asarray(example.speech.features.values) for example in examples]
        seen = [np.asarray(example.valid) for example in examples]
        learned = self.learned(features, values, seen, monitor)
        errors = [np.square(self.mapped(learned, f) - x)[s] for f, x, s in zip(features, values, seen, strict=True)]
        model = FrameModel(space, learned, np.concatenate(errors).mean(axis=0))
        return Fit(model, {"frames": sum(int(mask.sum()) for mask in seen)})

    def generate(  # noqa: D102
        self,
        model: FrameModel,
        speech: Speech,
        constraints: Constraints | None = None,  # noqa: ARG002 - compared, never edited
    ) -> Generation:
        mapped = self.mapped(model.map, np.asarray(speech.features.values))
        values, variance = model.space.restore(mapped, np.broadcast_to(model.spread, mapped.shape))
        motion = Motion(values, FRAME_RATE_HZ, model.space.channels)
        return Generation(motion, variance, speech.units, Trace(("all",), np.zeros(len(values), np.intp)))

    @abstractmethod
    def learned(
        self, features: Sequence[Single], values: Sequence[Array], seen: Sequence[NDArray[np.bool_]], monitor: Monitor
    ) -> Any:
        """Return what explains motion in its space [each shape=(T, Q)] by features [each shape=(T, 39)].

        seen : where the motion holds [each shape=(T,)]
        """

    @abstractmethod
    def mapped(self, learned: Any, features: Single) -> Array:
        """Return the motion in its space [shape=(T, Q)]."""


class Linear(Baseline):
    """Least squares of what ``heard`` gives for each frame."""

    strength: ClassVar[float] = 0.0

    @abstractmethod
    def heard(self, features: Single) -> Array:
        """Return the numbers that each frame's motion is a sum of [shape=(T, F)]."""

    def learned(  # noqa: D102
        self,
        features: Sequence[Single],
        values: Sequence[Array],
        seen: Sequence[NDArray[np.bool_]],
        monitor: Monitor,  # noqa: ARG002 - it takes seconds
    ) -> Array:
        moments, frames = None, 0
        for one, target, mask in zip(features, values, seen, strict=True):
            rows = self.heard(one)[mask]
            moments = moments or zero_statistics(rows.shape[1], target.shape[1])
            moments.add(rows, target[mask])
            frames += len(rows)
        if moments is None:
            return np.zeros((0, 0))
        return ridge(moments, np.zeros_like(moments.targets), self.strength * frames)

    def mapped(self, learned: Array, features: Single) -> Array:  # noqa: D102
        return self.heard(features) @ learned


@final
class MeanPose(Linear):
    """The mean of all frames, whatever is said."""

    def heard(self, features: Single) -> Array:  # noqa: D102
        return np.ones((len(features), 1))


@final
class Loudness(Linear):
    """A line of the smoothed log energy."""

    def heard(self, features: Single) -> Array:  # noqa: D102
        padded = np.pad(features[:, LOG_ENERGY].astype(float), SMOOTHING // 2, "edge")
        smooth = np.convolve(padded, np.full(SMOOTHING, 1 / SMOOTHING), "valid")
        return np.stack([smooth, np.ones(len(smooth))], axis=1)


@final
class SoundAround(Linear):
    """Ridge regression on the features of all frames within ±150 ms."""

    strength = STRENGTH

    def heard(self, features: Single) -> Array:  # noqa: D102
        frames = np.clip(np.arange(len(features))[:, None] + np.arange(-REACH, REACH + 1), 0, len(features) - 1)
        rows = features[frames].reshape(len(features), -1)
        return np.concatenate([rows, np.ones((len(rows), 1), rows.dtype)], axis=1).astype(float)
