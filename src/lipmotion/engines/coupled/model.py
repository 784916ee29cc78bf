"""The model of the coupled engine: chains, and how their posteriors become motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import AudioVisualObservations, Single
from lipmotion.engines.coupled.chains.model import Chains, Inference
from lipmotion.engines.coupled.chains.visual_streams import VisualStream, speech_observations
from lipmotion.engines.coupled.conversion.em_conversion import precision_statistics
from lipmotion.engines.coupled.conversion.mean_regression import RegressionInputs, VisualRegression
from lipmotion.motion.articulation import ArticulationPrior
from lipmotion.motion.closure import Closure
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.limits import MotionLimits, measure_limits
from lipmotion.motion.modulation_filter import ModulationFilter
from lipmotion.motion.space import MotionSpace
from lipmotion.motion.variance_scaling import VarianceScaling
from lipmotion.types import FRAME_RATE_HZ

Array = NDArray[np.float64]
AWAY_FROM_SPEECH_S = 0.45
"""In silence this far from speech the mouth is in the rest pose; nearer, it is still closing or gets ready."""
LARGEST_SPEECH_POSTERIOR = 0.05
"""Greatest posterior of speech in a frame that counts as silent."""
REST_PRECISION_FACTOR = 100.0
"""How many times more precise the rest pose is than the means that it replaces."""


@dataclass(frozen=True, eq=False)
class CoupledModel:
    """Coupled chains with everything that turns their posteriors into motion.

    space      : the motion space, of Q dimensions
    visual     : the visual streams, in the order of the chains' streams after speech
    regression : of the visual means: the inputs, and the regression of each visual stream; None: the means are those of
                 the chains' densities
    scaling    : factors of variance scaling, away from the rest pose [shape=(Q,)]
    rest_pose  : the pose in silence away from speech [shape=(Q,)]
    closure    : how the lips close; None: the motion has no opening
    prior      : the table of articulation in the speaker's range (None: there is none)
    modulation : restores fast movement (None: the motion stays as it is)
    """

    chains: Chains
    space: MotionSpace
    visual: tuple[VisualStream, ...]
    regression: tuple[RegressionInputs, tuple[VisualRegression, ...]] | None
    scaling: Array
    rest_pose: Array
    closure: Closure | None
    prior: ArticulationPrior | None = None
    modulation: ModulationFilter | None = None

    def __repr__(self) -> str:
        size = f"{self.chains.parameters} parameters, {self.space.dimensions} dimensions"
        return f"CoupledModel({', '.join(self.chains.streams)}; {size})"

    @cached_property
    def limits(self) -> MotionLimits:
        """The limits of generated motion: those of the poses and of the rest pose, widened by a standard deviation."""
        poses, deviation = self.pose_limits, np.zeros(self.space.dimensions)
        for stream in self.visual:
            deviation[stream.columns] = stream.deviation[: len(stream.columns)]
        low, high = np.minimum(poses.low, self.rest_pose), np.maximum(poses.high, self.rest_pose)
        return MotionLimits(low, high).extend(deviation)

    @cached_property
    def motion(self) -> LearnedMotion:
        """What turns means and precisions into motion: space, closure, limits, variance scaling, modulation filter."""
        scaling = VarianceScaling(self.scaling, self.rest_pose)
        return LearnedMotion(self.space, self.closure, self.limits, scaling, self.prior, self.modulation)

    @property
    def pose_limits(self) -> MotionLimits:
        """The limits of the means of all densities."""
        low, high = np.zeros(self.space.dimensions), np.zeros(self.space.dimensions)
        for number, stream in enumerate(self.visual, start=1):
            group = next(group for group in self.chains.groups if number in group.streams)
            means = group.stream_mixtures(number).means.astype(float)
            flat = means.reshape(-1, means.shape[2])
            poses = stream.unstandardised(flat, np.ones_like(flat))[0][:, 0]
            low[stream.columns], high[stream.columns] = measure_limits(poses)
        return MotionLimits(low, high)

    def speech_observations(self, features: Single) -> AudioVisualObservations:
        """Return observations of speech [shape=(T, 39)] in which no visual stream was observed."""
        return speech_observations(features, self.visual)

    def with_motion(self, observations: AudioVisualObservations, values: Array) -> AudioVisualObservations:
        """Return the observations with motion in the space [shape=(T, Q)] as the visual streams."""
        for number, stream in enumerate(self.visual, start=1):
            observations = observations.with_stream(number, stream.standardised(values))
        return observations

    def motion_statistics(self, inference: Inference) -> tuple[Array, Array]:
        """Return the expected means and precisions of the motion in its space [each shape=(T, 3, Q)].

        Axis 1: value, slope, curvature. In silence away from speech the mean is the rest pose.
        """
        shape = (inference.observations.frames, 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        inputs = self.regression_inputs(inference)
        for number, stream in enumerate(self.visual):
            if inputs is None or self.regression is None:
                precision, weighted = precision_statistics(self.chains, inference, number + 1)
                mean = weighted / np.maximum(precision, 1e-300)
            else:
                posterior = inference.posteriors.chains[self.chains.structure.chain_of(number + 1)]
                regression = self.regression[1][number]
                mean, precision = regression.means(inputs, posterior), regression.precisions(posterior)
            means[:, :, stream.columns], precisions[:, :, stream.columns] = stream.unstandardised(mean, precision)
        away = self.is_away_from_speech(inference.posteriors.chains[0])
        means[away] = 0
        means[away, 0] = self.rest_pose
        precisions[away] *= REST_PRECISION_FACTOR
        return means, precisions

    def frame_statistics(self, streams: Sequence[Array]) -> tuple[Array, Array]:
        """Return means and precisions of motion whose frames are converted one by one [each shape=(T, 3, Q)].

        streams : the values of all visual streams [each shape=(T, D)]
        These values are the means; only values have a precision, so parameter generation returns the means unchanged.
        """
        shape = (len(streams[0]), 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        for stream, values in zip(self.visual, streams, strict=True):
            mean, precision = stream.unstandardised(values, np.ones_like(values))
            means[:, :, stream.columns], precisions[:, :, stream.columns] = mean, precision
        precisions[:, 1:] = 0
        return means, precisions

    def regression_inputs(self, inference: Inference) -> Single | None:
        """Return the regression inputs of all frames [shape=(T, F + 1)]; None: there is no regression."""
        if self.regression is None:
            return None
        return self.regression[0](inference.observations.streams[0], inference.posteriors.chains[0])

    def is_away_from_speech(self, posterior: Single) -> NDArray[np.bool_]:
        """Return whether each frame is silence away from speech, by posteriors of the first chain [shapes=(T,), (T,
        N)].
        """
        structure = self.chains.structure
        silent = np.repeat([structure.chains[0].silent(unit) for unit in structure.units[0]], structure.states)
        speech = posterior @ (~silent).astype(np.float32) > LARGEST_SPEECH_POSTERIOR
        reach = round(AWAY_FROM_SPEECH_S * FRAME_RATE_HZ)
        speech_before = np.cumsum(np.pad(speech.astype(np.intp), (reach + 1, reach)))
        return np.asarray(speech_before[2 * reach + 1 :] == speech_before[: -2 * reach - 1])
