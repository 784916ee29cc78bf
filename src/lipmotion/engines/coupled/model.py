"""What the coupled engine learns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Observed, Single
from lipmotion.engines.coupled.chains.model import Chains, Inferred
from lipmotion.engines.coupled.chains.visual_streams import VisualStream, unseen
from lipmotion.engines.coupled.conversion.em import statistics
from lipmotion.engines.coupled.conversion.regression import Following, Surroundings
from lipmotion.motion.closure import Closure
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.limits import MotionLimits, limits_of
from lipmotion.motion.space import MotionSpace
from lipmotion.motion.variance_scaling import VarianceScaling
from lipmotion.types import FRAME_RATE_HZ

Array = NDArray[np.float64]
CALM_S = 0.45
"""Silence this far from speech is rest: nearer, the mouth closes or gets ready."""
MOST_SPEECH = 0.05
"""Of the probability of speech in a silent frame."""
FIRM = 100.0
"""How many times more precise the pose at rest is than what is around it."""


@dataclass(frozen=True, eq=False)
class CoupledModel:
    """Chains, and how what they emit becomes motion.

    space   : the Q dimensions in which motion is modelled
    visual  : the streams that they are, in the order of the chains' streams after speech
    follow  : how visual means follow what is around a frame (None: they are those of the chains' densities)
    gain    : by how much movements away from rest are made larger [shape=(Q,)]
    rest    : the pose in silence [shape=(Q,)]
    closure : how the lips close (None: the motion has no opening)
    """

    chains: Chains
    space: MotionSpace
    visual: tuple[VisualStream, ...]
    follow: tuple[Surroundings, tuple[Following, ...]] | None
    gain: Array
    rest: Array
    closure: Closure | None

    @cached_property
    def limits(self) -> MotionLimits:
        """Between which values motion lies."""
        poses, deviation = self.poses, np.zeros(self.space.dimensions)
        for stream in self.visual:
            deviation[stream.columns] = stream.deviation[: len(stream.columns)]
        return MotionLimits(np.minimum(poses.low, self.rest), np.maximum(poses.high, self.rest)).widened(deviation)

    @cached_property
    def motion(self) -> LearnedMotion:
        """The end of the path from speech to motion."""
        return LearnedMotion(self.space, self.closure, self.limits, VarianceScaling(self.gain, self.rest))

    @property
    def poses(self) -> MotionLimits:
        """Between which values the means of all densities lie."""
        low, high = np.zeros(self.space.dimensions), np.zeros(self.space.dimensions)
        for number, stream in enumerate(self.visual, start=1):
            group = next(group for group in self.chains.groups if number in group.streams)
            means = group.of_stream(number).means.astype(float)
            flat = means.reshape(-1, means.shape[2])
            low[stream.columns], high[stream.columns] = limits_of(stream.restored(flat, np.ones_like(flat))[0][:, 0])
        return MotionLimits(low, high)

    def unseen(self, features: Single) -> Observed:
        """Return speech [shape=(T, 39)] with nothing seen."""
        return unseen(features, self.visual)

    def statistics(self, inferred: Inferred) -> tuple[Array, Array]:
        """Return means and precisions of the motion in its space [each shape=(T, 3, Q)]."""
        shape = (inferred.observed.frames, 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        around = self.around(inferred)
        for number, stream in enumerate(self.visual):
            if around is None or self.follow is None:
                precision, weighted = statistics(
                    self.chains, inferred.posteriors, inferred.evidence, inferred.lattice, number + 1
                )
                mean = weighted / np.maximum(precision, 1e-300)
            else:
                gate = inferred.posteriors.chains[self.chains.structure.chain_of(number + 1)]
                following = self.follow[1][number]
                mean, precision = following.means(around, gate), following.precisions(gate)
            means[:, :, stream.columns], precisions[:, :, stream.columns] = stream.restored(mean, precision)
        resting = self.resting(inferred.posteriors.chains[0])
        means[resting] = 0
        means[resting, 0] = self.rest
        precisions[resting] *= FIRM
        return means, precisions

    def resting(self, posterior: Single) -> NDArray[np.bool_]:
        """Return which frames are silence away from speech [shape=(T,)].

        posterior : of the first chain's states [shape=(T, N)]
        """
        structure = self.chains.structure
        silent = np.repeat([structure.chains[0].silent(unit) for unit in structure.units[0]], structure.states)
        spoken = posterior @ (~silent).astype(np.float32) > MOST_SPEECH
        reach = round(CALM_S * FRAME_RATE_HZ)
        near = np.cumsum(np.pad(spoken.astype(np.intp), (reach + 1, reach)))
        return np.asarray(near[2 * reach + 1 :] == near[: -2 * reach - 1])

    def seen(self, observed: Observed, values: Array) -> Observed:
        """Return what was observed, with motion in the space [shape=(T, Q)] as if it had been seen."""
        for number, stream in enumerate(self.visual, start=1):
            observed = observed.given(number, stream.observed(values))
        return observed

    def frames(self, streams: Sequence[Array]) -> tuple[Array, Array]:
        """Return the values of all visual streams [each shape=(T, D)] as means, and precisions of the values alone.

        Parameter generation gives such means back as they are.
        """
        shape = (len(streams[0]), 3, self.space.dimensions)
        means, precisions = np.zeros(shape), np.zeros(shape)
        for stream, values in zip(self.visual, streams, strict=True):
            mean, precision = stream.restored(values, np.ones_like(values))
            means[:, :, stream.columns], precisions[:, :, stream.columns] = mean, precision
        precisions[:, 1:] = 0
        return means, precisions

    def around(self, inferred: Inferred) -> Single | None:
        """Return what visual means follow, in numbers [shape=(T, F + 1)]; None: they follow nothing."""
        if self.follow is None:
            return None
        return self.follow[0](inferred.observed.streams[0], inferred.posteriors.chains[0])
