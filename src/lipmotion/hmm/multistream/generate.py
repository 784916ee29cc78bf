"""From states to motion: means and precisions of every frame, and the most probable trajectory behind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.align import StatePath
from lipmotion.hmm.multistream.model import JointHmm, Part
from lipmotion.hmm.multistream.streams import MOTION
from lipmotion.kernels.banded import normal_equations, pin, solve
from lipmotion.stats.delta_windows import with_dynamics

Array = NDArray[np.float64]
ITERATIONS = 20
"""Most steps of EM; a dozen are enough nearly always."""
LEAST_GAIN = 1e-4
"""Log likelihood a frame that a step of EM must gain for another one."""
LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class FrameDensities:
    """A mixture of M diagonal Gaussians for every frame, of static value, Δ and Δ².

    log_weights : [shape=(T, M)]
    means, precisions : [shape=(T, M, 3, Q)], in units of the motion
    Rows of dynamics that stick out at the ends have no precision.
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


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A generated trajectory.

    values, variance : [shape=(T, Q)], in units of the motion; the variance is the model's own, given its Gaussians
    log_likelihoods  : of the trajectory with its dynamics, after every step of EM; it never falls
    """

    values: Array
    variance: Array
    log_likelihoods: tuple[float, ...]


def densities_along(hmm: JointHmm, path: StatePath) -> FrameDensities:
    """Return what the motion stream says along a path of states.

    Raises InputError: the model has no motion, or it is switched off in synthesis.
    """
    part, weight = _motion(hmm)
    leaves = part.forest.leaves(path.states.places)
    means, precisions = _in_units(part, weight)
    log_weights = part.tied.mixtures.log_weights.astype(float)
    chosen = leaves[path.frames]
    return _without_ends(FrameDensities(log_weights[chosen], means[chosen], precisions[chosen]))


def densities_over(hmm: JointHmm, leaves: NDArray[np.intp], posterior: Array) -> FrameDensities:
    """Return what the motion stream says of all paths: in every frame, one Gaussian of all states together.

    leaves    : of the motion stream, of S states
    posterior : [shape=(T, S)], how probable each state is in each frame
    The trajectory that maximises the expected log density has, in every frame, the sum of the precisions, and the mean
    weighted by them. Those of a mixture count as its weights say.
    Raises InputError: as ``densities_along``, or the shapes do not fit.
    """
    part, weight = _motion(hmm)
    if posterior.ndim != 2 or posterior.shape[1] != len(leaves):
        raise InputError(f"posteriors of shape {posterior.shape}, required (T, {len(leaves)}): one of each state")
    used, local = np.unique(leaves, return_inverse=True)
    by_leaf = np.zeros((len(used), len(posterior)))
    np.add.at(by_leaf, local, posterior.T)
    means, precisions = _in_units(part, weight)
    shares = np.exp(part.tied.mixtures.log_weights[used].astype(float))[:, :, None, None]
    precision = (shares * precisions[used]).sum(axis=1)
    weighted = (shares * precisions[used] * means[used]).sum(axis=1)
    shape = (len(posterior), 1, *precision.shape[1:])
    total = (by_leaf.T @ precision.reshape(len(used), -1)).reshape(shape)
    mean = (by_leaf.T @ weighted.reshape(len(used), -1)).reshape(shape) / np.maximum(total, np.finfo(float).tiny)
    return _without_ends(FrameDensities(np.zeros((len(posterior), 1)), mean, total))


def densities_of(hmm: JointHmm, paths: Sequence[StatePath]) -> FrameDensities:
    """Return what the motion stream says of several paths that are as probable (``JointRecogniser.sampled_paths``).

    Raises InputError: as ``densities_over``, or no paths, or of different lengths.
    """
    part, _ = _motion(hmm)
    if not paths or len({len(path.frames) for path in paths}) > 1:
        raise InputError(f"{len(paths)} paths, required one or more of the same length")
    chosen = np.stack([part.forest.leaves(path.states.places)[path.frames] for path in paths])
    leaves, local = np.unique(chosen, return_inverse=True)
    posterior = np.zeros((len(paths[0].frames), len(leaves)))
    np.add.at(posterior, (np.arange(len(posterior)), local.reshape(chosen.shape)), 1 / len(paths))
    return densities_over(hmm, leaves, posterior)


def generate(
    densities: FrameDensities, pins: Mapping[tuple[int, int], float] | None = None, iterations: int = ITERATIONS
) -> Trajectory:
    """Return the trajectory that is most probable together with its dynamics.

    pins       : (frame, dimension) -> the value that the trajectory must take
    iterations : most steps of EM over the Gaussians of mixtures; for single ones there is a closed form
    Source: Hofer 2008, Eqs. 6–11, with Δ²x_t = x_{t−1} − 2x_t + x_{t+1} (the print lost the minus sign); for mixtures,
    EM over the components as in Tokuda et al. 2000, case 3 with one state path.
    Cost: O(T·M·Q) a step.
    Raises InputError: a pin outside the frames or dimensions.
    """
    frames, _, _, dimensions = densities.means.shape
    for frame, dimension in pins or {}:
        if not (0 <= frame < frames and 0 <= dimension < dimensions):
            raise InputError(f"a pin at {(frame, dimension)}, required within {frames} frames, {dimensions} dimensions")
    share = np.exp(densities.log_weights)
    values, variance = _solved(densities, share, pins or {})
    found: list[float] = []
    for _ in range(iterations):
        components = densities.log_components(values)
        best = components.max(axis=1, keepdims=True)
        share = np.exp(components - best)
        found.append(float((best[:, 0] + np.log(share.sum(axis=1))).sum()))
        done = share.shape[1] == 1 or (len(found) > 1 and found[-1] - found[-2] < LEAST_GAIN * frames)
        if done or len(found) == iterations:
            break
        values, variance = _solved(densities, share / share.sum(axis=1, keepdims=True), pins or {})
    return Trajectory(values, variance, tuple(found))


def settled(densities: FrameDensities) -> tuple[Array, Array]:
    """Return one Gaussian a frame: mean and precision [each shape=(T, 3, Q)].

    Those of mixtures count as much as EM over the components finds that they stand behind the most probable trajectory.
    """
    if densities.log_weights.shape[1] == 1:
        return densities.means[:, 0], densities.precisions[:, 0]
    components = densities.log_components(generate(densities).values)
    share = np.exp(components - components.max(axis=1, keepdims=True))
    return _merged(densities, share / share.sum(axis=1, keepdims=True))


def _merged(densities: FrameDensities, share: Array) -> tuple[Array, Array]:
    shared = densities.precisions * share[:, :, None, None]
    precision = shared.sum(axis=1)
    return (shared * densities.means).sum(axis=1) / np.maximum(precision, np.finfo(float).tiny), precision


def _solved(densities: FrameDensities, share: Array, pins: Mapping[tuple[int, int], float]) -> tuple[Array, Array]:
    """Return the trajectory and its variance, each Gaussian with its share in its frame [shape=(T, M)]."""
    bands = normal_equations(*_merged(densities, share))
    for (frame, dimension), value in pins.items():
        pin(bands, frame, dimension, value)
    values, variance = solve(bands)
    for frame, dimension in pins:
        variance[frame, dimension] = 0
    return values, variance


def _motion(hmm: JointHmm) -> tuple[Part, float]:
    weight = hmm.config.synthesis.motion
    if MOTION not in hmm.parts or not weight:
        raise InputError("the model has no motion, or it is switched off in synthesis; train on recordings with a face")
    return hmm.parts[MOTION], weight


def _in_units(part: Part, weight: float) -> tuple[Array, Array]:
    """Return means and weighted precisions of all leaves in units of the motion [shape=(G, M, 3, Q)]."""
    mixtures, deviation = part.tied.mixtures, part.scale.deviation
    G, M, D = mixtures.size
    means = mixtures.means * deviation + part.scale.mean
    precisions = weight / (mixtures.variances * deviation**2)
    return means.reshape(G, M, 3, D // 3), precisions.reshape(G, M, 3, D // 3)


def _without_ends(densities: FrameDensities) -> FrameDensities:
    precisions = densities.precisions.copy()
    precisions[[0, -1], :, 1:] = 0
    return FrameDensities(densities.log_weights, densities.means, precisions)
