"""Generation of motion from states: Gaussians of every frame, and the most probable trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import MOTION
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.recognise import StatePath
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.stats.curves import with_dynamics

Array = NDArray[np.float64]
ITERATIONS = 20
"""Largest number of steps of EM; a dozen are enough nearly always."""
MIN_GAIN = 1e-4
"""EM ends when a step raises the log likelihood per frame by less."""
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class FrameDensities:
    """A mixture of M diagonal Gaussians for every frame, of static values, Δ and Δ².

    log_weights : [shape=(T, M)]
    means, precisions : [shape=(T, M, 3, Q)], in units of the motion
    Δ and Δ² of the first and last frame, which need frames outside, have precision 0.
    """

    log_weights: Array
    means: Array
    precisions: Array

    def log_components(self, trajectory: Array) -> Array:
        """Return log weight + log density of a trajectory [shape=(T, Q)] and its dynamics [shape=(T, M)]."""
        off = with_dynamics(trajectory)[:, None] - self.means
        used = self.precisions > 0
        scale = np.log(np.where(used, self.precisions, 1)) - LOG_2PI * used
        return self.log_weights + 0.5 * (scale - self.precisions * off * off).sum(axis=(2, 3))


def select_densities(hmm: JointHmm, path: StatePath) -> FrameDensities:
    """Return the densities of motion along a path of states. Raises InputError: no motion, or its weight is 0."""
    weight = hmm.config.synthesis.motion
    if MOTION not in hmm.models or not weight:
        raise InputError("the model has no motion, or it is switched off in synthesis; train on recordings with a face")
    model = hmm.models[MOTION]
    mixtures, deviation = model.tied.mixtures, model.scale.deviation
    G, M, D = mixtures.size
    means = (mixtures.means * deviation + model.scale.mean).reshape(G, M, 3, D // 3)
    precisions = (weight / (mixtures.variances * deviation**2)).reshape(G, M, 3, D // 3)
    chosen = model.forest.leaves(path.states.triphones)[path.frames]
    precisions = precisions[chosen]
    precisions[[0, -1], :, 1:] = 0  # Δ and Δ² of the first and last frame count for nothing
    return FrameDensities(mixtures.log_weights[chosen].astype(float), means[chosen], precisions)


def solve_trajectory(densities: FrameDensities, iterations: int = ITERATIONS) -> tuple[Array, tuple[float, ...]]:
    """Return the trajectory that is most probable together with its dynamics, and its log likelihood by step.

    iterations : most steps of EM over the Gaussians of mixtures; for single ones there is a closed form
    Source: Hofer 2008, Eqs. 6–11, with Δ²x_t = x_{t−1} − 2x_t + x_{t+1} (the print lost the minus sign); for mixtures,
    EM over the components as in Tokuda et al. 2000, case 3 with one state path.
    Cost: O(T·M·Q) a step.
    """
    values, _ = solve_mlpg(*_merge(densities, np.exp(densities.log_weights)))
    log_likelihoods: list[float] = []
    for _ in range(iterations):
        components = densities.log_components(values)
        best = components.max(axis=1, keepdims=True)
        share = np.exp(components - best)
        log_likelihoods.append(float((best[:, 0] + np.log(share.sum(axis=1))).sum()))
        gain = np.diff(log_likelihoods[-2:])
        if share.shape[1] == 1 or len(log_likelihoods) == iterations or (gain < MIN_GAIN * len(values)).any():
            break
        values, _ = solve_mlpg(*_merge(densities, share / share.sum(axis=1, keepdims=True)))
    return values, tuple(log_likelihoods)


def merge_gaussians(densities: FrameDensities) -> tuple[Array, Array]:
    """Return one Gaussian for every frame: mean and precision [each shape=(T, 3, Q)]."""
    if densities.log_weights.shape[1] == 1:
        return densities.means[:, 0], densities.precisions[:, 0]
    components = densities.log_components(solve_trajectory(densities)[0])
    share = np.exp(components - components.max(axis=1, keepdims=True))
    return _merge(densities, share / share.sum(axis=1, keepdims=True))


def _merge(densities: FrameDensities, share: Array) -> tuple[Array, Array]:
    """Return mean and precision of every frame [each shape=(T, 3, Q)], given posteriors of the Gaussians (T, M)."""
    shared = densities.precisions * share[:, :, None, None]
    precision = shared.sum(axis=1)
    return (shared * densities.means).sum(axis=1) / np.maximum(precision, np.finfo(float).tiny), precision
