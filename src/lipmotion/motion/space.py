"""The motion space: the dimensions in which motion is modelled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError
from lipmotion.stats.delta_windows import mark_known_dynamics
from lipmotion.stats.pca import Pca, fit_pca
from lipmotion.types import Channel, Example


@dataclass(frozen=True, eq=False)
class MotionSpace:
    """The dimensions of motion in a model: distances as they are, points reduced to principal components.

    channels : the P channels of the motion
    direct   : int array [shape=(P',)], columns of the channels that are modelled as they are
    points   : principal components of all other channels, K of them (None: there are no others); Q = P' + K
    """

    channels: tuple[Channel, ...]
    direct: NDArray[np.intp]
    points: Pca | None

    @property
    def direct_names(self) -> tuple[str, ...]:
        """The names of the channels that are modelled as they are."""
        return tuple(self.channels[channel].name for channel in self.direct)

    @property
    def dimensions(self) -> int:
        """The number of dimensions, Q."""
        return len(self.direct) + (len(self.points.basis) if self.points is not None else 0)

    def reduce(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return motion of the channels [shape=(T, P)] in the motion space [shape=(T, Q)]."""
        direct = values[:, self.direct]
        if self.points is None:
            return direct
        return np.concatenate([direct, self.points.project(values[:, self._reduced])], axis=1)

    def restore(
        self, values: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and variances of all channels [each shape=(T, P)].

        values, variance : in the motion space [each shape=(T, Q)]
        """
        motion, spread = (np.empty((len(values), len(self.channels))) for _ in range(2))
        count = len(self.direct)
        motion[:, self.direct], spread[:, self.direct] = values[:, :count], variance[:, :count]
        if self.points is not None:
            motion[:, self._reduced] = self.points.restore(values[:, count:])
            spread[:, self._reduced] = variance[:, count:] @ np.square(self.points.basis)
        return motion, spread

    @property
    def mixing(self) -> NDArray[np.float64]:
        """The matrix from variances of the dimensions to variances of the channels [shape=(Q, P)]."""
        mixing, count = np.zeros((self.dimensions, len(self.channels))), len(self.direct)
        mixing[np.arange(count), self.direct] = 1
        if self.points is not None:
            mixing[count:, self._reduced] = np.square(self.points.basis)
        return mixing

    @property
    def _reduced(self) -> NDArray[np.intp]:
        return np.setdiff1d(np.arange(len(self.channels)), self.direct)


def fit_space(channels: tuple[Channel, ...], poses: NDArray[np.float64], components: int) -> MotionSpace:
    """Return the motion space of some poses [shape=(N, P)]; all channels but points (``x_17``, ...) stay as they are.

    components : principal components that the points are reduced to
    """
    is_point = np.array([channel.name[:2] in ("x_", "y_", "z_") for channel in channels])
    points = fit_pca(poses[:, is_point], components) if is_point.any() else None
    return MotionSpace(channels, np.nonzero(~is_point)[0].astype(np.intp), points)


def fit_reduced_motion(examples: Sequence[Example], components: int) -> tuple[MotionSpace, list[NDArray[np.float64]]]:
    """Return the motion space of some examples, and the motion of each in it [each shape=(T, Q)].

    components : principal components that all point channels are reduced to
    Raises CorpusError: no example has valid motion, or the examples have different channels.
    """
    if not any(mark_known_dynamics(example.valid).any() for example in examples):
        raise CorpusError(f"none of {len(examples)} examples has motion to learn from; prepare a corpus with faces")
    channels = {example.motion.channels for example in examples}
    if len(channels) > 1:
        raise CorpusError("the utterances have different motion channels; train on one kind of corpus at a time")
    poses = np.concatenate([example.motion.values[example.valid] for example in examples])
    space = fit_space(channels.pop(), poses, components)
    return space, [space.reduce(example.motion.values.astype(float)) for example in examples]
