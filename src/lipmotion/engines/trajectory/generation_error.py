"""Means that make the generated trajectory, rather than each frame alone, come close to the original."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import Emission
from lipmotion.engines.trajectory.training_data import TrainingClip, TrainingOptions, rows_of
from lipmotion.kernels.banded import generate, normal_equations, solve
from lipmotion.stats.delta_windows import with_dynamics

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clip:
    """An example ready for generation: densities of all frames, their precisions, and what is left to explain."""

    rows: NDArray[np.intp]
    precisions: Array
    seen: NDArray[np.intp]
    error: Array


def minimise_generation_error(emission: Emission, observed: Sequence[TrainingClip], how: TrainingOptions) -> Emission:
    """Return the same densities with means that minimise the squared error of the generated trajectories.

    Precisions stay as they are; then trajectories are linear in the means, and the error a quadratic, whose minimum is
    approached by conjugate gradients from the means there are: ``how.trajectory_steps`` of them, few, for the end of
    the way fits the training list only.
    Source: Wu & Wang 2006 (minimum generation error training); the closed form by conjugate gradients is our own.
    """
    clips = [_clip(emission, one, how) for one in observed]
    counts = np.zeros(len(emission.means))
    for clip in clips:
        np.add.at(counts, clip.rows, 1)
    step, total = np.zeros(emission.means.shape), np.zeros(emission.means.shape)
    weight = np.where(counts > 0, 1 / np.maximum(counts, 1), 0)[:, None, None]  # frequent densities move no faster
    residual = [clip.error for clip in clips]
    before = np.zeros(emission.means.shape[2])
    for _ in range(how.trajectory_steps):
        gradient = _adjoint(clips, residual, emission.means.shape)
        power = (gradient * gradient * weight).sum(axis=(0, 1))
        step = gradient * weight + step * np.where(before > 0, power / np.maximum(before, 1e-300), 0)
        moved = list(_forward(clips, step))
        reach = np.sum([np.square(move).sum(axis=0) for move in moved], axis=0)
        length = np.where(reach > 0, power / np.maximum(reach, 1e-300), 0)
        total += length * step
        residual = [left - length * move for left, move in zip(residual, moved, strict=True)]
        before = power
    return replace(emission, means=(emission.means + total).astype(np.float32))


def _clip(emission: Emission, one: TrainingClip, how: TrainingOptions) -> Clip:
    rows = rows_of(emission, one.places, how.cut)
    means, precisions = emission.statistics(rows, one.features, slice(None))
    generated, _ = generate(means, precisions)
    return Clip(rows, precisions, one.frames, one.rows[:, 0] - generated[one.frames])


def _forward(clips: Sequence[Clip], means: Array) -> Iterator[Array]:
    """Give, clip by clip, the trajectory behind some means [shape=(L, 3, Q)] in the frames that were seen."""
    for clip in clips:
        yield generate(means[clip.rows], clip.precisions)[0][clip.seen]


def _adjoint(clips: Sequence[Clip], errors: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """Return the gradient of half the squared error, downhill, for each mean [shape=(L, 3, Q)]."""
    total = np.zeros(shape)
    for clip, error in zip(clips, errors, strict=True):
        main, first, second, right = normal_equations(np.zeros_like(clip.precisions), clip.precisions)
        right[clip.seen] = error
        pulled, _ = solve((main, first, second, right))
        np.add.at(total, clip.rows, clip.precisions * with_dynamics(pulled))
    return total
