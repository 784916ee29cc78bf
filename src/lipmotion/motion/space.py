"""The dimensions in which motion is modelled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError
from lipmotion.stats.delta_windows import dynamics_known
from lipmotion.stats.pca import Pca, fit_pca
from lipmotion.types import Channel, Example


@dataclass(frozen=True, eq=False)
class MotionSpace:
    """Distances as they are, points in their principal components.

    channels : the P channels of the motion
    direct   : the channels that are modelled as they are [shape=(P',)]
    points   : the space of all others (None: there are none); Q = P' + its dimensions
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
        """Q."""
        return len(self.direct) + (len(self.points.basis) if self.points is not None else 0)

    def reduce(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return motion [shape=(T, P)] as the model sees it [shape=(T, Q)]."""
        direct = values[:, self.direct]
        if self.points is None:
            return direct
        return np.concatenate([direct, self.points.project(values[:, self._reduced])], axis=1)

    def restore(
        self, values: NDArray[np.float64], variance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and variances [shape=(T, Q)] as those of the channels [shape=(T, P)]."""
        motion, spread = (np.empty((len(values), len(self.channels))) for _ in range(2))
        count = len(self.direct)
        motion[:, self.direct], spread[:, self.direct] = values[:, :count], variance[:, :count]
        if self.points is not None:
            motion[:, self._reduced] = self.points.restore(values[:, count:])
            spread[:, self._reduced] = variance[:, count:] @ np.square(self.points.basis)
        return motion, spread

    @property
    def mixing(self) -> NDArray[np.float64]:
        """What the variance of each dimension adds to that of each channel [shape=(Q, P)]."""
        mixing, count = np.zeros((self.dimensions, len(self.channels))), len(self.direct)
        mixing[np.arange(count), self.direct] = 1
        if self.points is not None:
            mixing[count:, self._reduced] = np.square(self.points.basis)
        return mixing

    @property
    def _reduced(self) -> NDArray[np.intp]:
        return np.setdiff1d(np.arange(len(self.channels)), self.direct)


def fit_space(channels: tuple[Channel, ...], seen: NDArray[np.float64], components: int) -> MotionSpace:
    """Return the space of some motion [shape=(N, P)]: all but the points (``x_17``, ...) are kept as they are."""
    is_point = np.array([channel.name[:2] in ("x_", "y_", "z_") for channel in channels])
    points = fit_pca(seen[:, is_point], components) if is_point.any() else None
    return MotionSpace(channels, np.nonzero(~is_point)[0].astype(np.intp), points)


def fit_reduced_motion(examples: Sequence[Example], components: int) -> tuple[MotionSpace, list[NDArray[np.float64]]]:
    """Return the space of some examples' motion, and the motion of each in it [each shape=(T, Q)].

    Raises CorpusError: no motion was seen, or the examples have different channels.
    """
    if not any(dynamics_known(example.valid).any() for example in examples):
        raise CorpusError(f"none of {len(examples)} examples has motion to learn from; prepare a corpus with faces")
    found = {example.motion.channels for example in examples}
    if len(found) > 1:
        raise CorpusError("the utterances have different motion channels; train on one kind of corpus at a time")
    seen = np.concatenate([example.motion.values[example.valid] for example in examples])
    space = fit_space(found.pop(), seen, components)
    return space, [space.reduce(example.motion.values.astype(float)) for example in examples]
