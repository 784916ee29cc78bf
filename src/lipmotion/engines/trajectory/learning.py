"""What training works with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.contexts import Cut, Place


@dataclass(frozen=True)
class Learning:
    """How motion is learned.

    cut        : how phones are cut into parts
    components : dimensions that all point channels (``x_17``, ...) are reduced to
    tree_factor: what a split of a tree must gain, in units of its description length
    least_frames : frames that a leaf must have
    shrinkage, variance_shrinkage : frames that the mean, and the variance, of the node above count for
    listens    : let the means follow the sound around the frame
    axes       : numbers that the sound around a frame is reduced to
    ridge, shared_ridge : how strongly a regression is drawn towards the one above it, and the shared one towards none
    ridge_frames : frames that a node must have for a regression of its own
    """

    cut: Cut
    components: int
    tree_factor: float
    least_frames: float
    shrinkage: float
    variance_shrinkage: float
    listens: bool
    axes: int
    ridge: float
    shared_ridge: float
    ridge_frames: float


@dataclass(frozen=True, eq=False)
class Observed:
    """The frames of one example that were seen with both neighbours.

    features : of the whole example [shape=(T, D)]
    frames   : int array [shape=(N,)], which frames these are
    rows     : float32 array [shape=(N, 3, Q)], their static value, Δ and Δ²
    places   : what is said there
    """

    features: NDArray[np.float32]
    frames: NDArray[np.intp]
    rows: NDArray[np.float32]
    places: list[Place]
