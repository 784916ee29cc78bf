"""Options and data of the training of the trajectory engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import Emission
from lipmotion.motion.frame_labels import FullContextState, StateLayout
from lipmotion.types import Speech


@dataclass(frozen=True)
class TrainingOptions:
    """Options of the training, from a ``TrajectoryConfig``.

    layout       : the states of phones and silences
    components   : principal components that all point channels (``x_17``, ...) are reduced to
    tree_factor  : gain that a split of a decision tree must have, in units of its description length
    least_frames : smallest number of frames of a leaf
    shrinkage, variance_shrinkage : weights, in frames, of the mean and of the variance of the parent node
    acoustic_regression : regress the means on the acoustic features around the frame
    acoustic_components : principal components that these features are reduced to
    ridge, shared_ridge : ridge parameters: of a regression towards that of the parent node, and of the regression that
                   all nodes share towards zero
    ridge_frames : smallest number of frames of a node with a regression of its own
    joint_recogniser : train the joint model as well
    epochs : how often the training of the predictor uses each recording
    articulation : lean on the table of articulation
    predictor : name of the predictor, or ``auto``
    modulation_filter : strength of the filter of generated motion; 0: none
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
    epochs: int
    articulation: bool
    predictor: str
    modulation_filter: float


@dataclass(frozen=True, eq=False)
class TrainingClip:
    """One example, prepared for training.

    states   : full-context state of each frame [length T]
    frames   : int array [shape=(N,)], the frames that are valid and have valid neighbours
    rows     : float32 array [shape=(N, 3, Q)], static value, Δ and Δ² of the motion in these frames
    """

    speech: Speech
    states: list[FullContextState]
    frames: NDArray[np.intp]
    rows: NDArray[np.float32]

    @property
    def features(self) -> NDArray[np.float32]:
        """Acoustic features [shape=(T, D)]."""
        return np.asarray(self.speech.features.values)

    @property
    def training_states(self) -> list[FullContextState]:
        """Full-context state of each frame of ``frames`` [length N]."""
        return [self.states[frame] for frame in self.frames]


def density_rows(emission: Emission, states: Sequence[FullContextState], layout: StateLayout) -> NDArray[np.intp]:
    """Return the number of the density of each state [shape=(len(states),)]."""
    distinct = {state: emission.row(state, layout) for state in dict.fromkeys(states)}
    return np.array([distinct[state] for state in states], np.intp)
