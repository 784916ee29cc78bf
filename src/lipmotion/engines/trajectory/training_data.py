"""What training works with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import Emission
from lipmotion.motion.frame_labels import FullContextState, StateLayout


@dataclass(frozen=True)
class TrainingOptions:
    """How motion is learned.

    layout     : the states of phones and silences
    components : dimensions that all point channels (``x_17``, ...) are reduced to
    tree_factor: what a split of a tree must gain, in units of its description length
    least_frames : frames that a leaf must have
    shrinkage, variance_shrinkage : frames that the mean, and the variance, of the node above count for
    acoustic_regression : regress the means on the acoustic features around the frame
    acoustic_components : principal components that these features are reduced to
    ridge, shared_ridge : how strongly a regression is drawn towards the one above it, and the shared one towards none
    ridge_frames : frames that a node must have for a regression of its own
    joint_recogniser : train the joint model as well
    """

    layout: StateLayout
    components: int
    tree_factor: float
    least_frames: float
    shrinkage: float
    variance_shrinkage: float
    acoustic_regression: bool
    acoustic_components: int
    ridge: float
    shared_ridge: float
    ridge_frames: float
    joint_recogniser: bool


@dataclass(frozen=True, eq=False)
class TrainingClip:
    """One example.

    features : [shape=(T, D)]
    places   : what is said in each frame [length T]
    frames   : int array [shape=(N,)], those that were seen with both neighbours
    rows     : float32 array [shape=(N, 3, Q)], static value, Δ and Δ² there
    """

    features: NDArray[np.float32]
    states: list[FullContextState]
    frames: NDArray[np.intp]
    rows: NDArray[np.float32]

    @property
    def training_states(self) -> list[FullContextState]:
        """What is said in the frames that were seen [length N]."""
        return [self.states[frame] for frame in self.frames]


def density_rows(emission: Emission, where: Sequence[FullContextState], layout: StateLayout) -> NDArray[np.intp]:
    """Return the density of each place [shape=(len(where),)]."""
    distinct = {place: emission.row(place, layout) for place in dict.fromkeys(where)}
    return np.array([distinct[place] for place in where], np.intp)
