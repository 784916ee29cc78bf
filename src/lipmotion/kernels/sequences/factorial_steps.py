"""One frame of a factorial hidden Markov model, forward and backward, by NumPy."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.kernels.sequences.loops import FrameDensity, LoopTransitions

Joint = NDArray[np.floating[Any]]
"""[shape=(Na, Nv)]"""
WHOLE = {np.dtype(np.float32): 1e16, np.dtype(np.float64): 1e70}
"""By precision: the sum of the probabilities of a frame. They are raised to 1 divided by this where they are less."""
LEAST_TOTAL = 1e-150
"""Least sum of probabilities times densities, as a share of the whole; smaller ones are computed in logarithms."""


class FramePosteriors(NamedTuple):
    """Posteriors of a frame.

    audio, visual, pair : [shapes=(Na,), (Nv,), (P,)], of the states of each loop, and of joint states of their own
    overlap             : the sum of forward times backward probabilities, by which posteriors were divided, as a share
        of the product of both wholes
    """

    audio: NDArray[np.float64]
    visual: NDArray[np.float64]
    pair: NDArray[np.float64]
    overlap: float


class BackwardStep(NamedTuple):
    """The result of a step back to the frame before.

    frame    : its posteriors
    backward : its backward probabilities times densities, normalised
    audio_entered, visual_entered : [shapes=(U, U)], expected number of transitions from each unit to each, divided by
        the probability of the transition
    """

    frame: FramePosteriors
    backward: Joint
    audio_entered: Joint
    visual_entered: Joint


def forward_step(
    before: Joint, audio: LoopTransitions, visual: LoopTransitions, density: FrameDensity
) -> tuple[Joint, Joint, float]:
    """Return forward probabilities one frame on, and two values from the computation.

    Returns the probabilities, normalised [shape=(Na, Nv)]; the probabilities of the last visual states after the audio
    loop's transition only [shape=(Na, Uv)]; and the log of the first ones' sum before they were normalised (-inf: all
    are 0).
    """
    moved = audio.forward(before)
    joint, log_total = times_density(visual.forward(moved.T).T, density, before.dtype)
    return joint, moved[:, -len(visual.leaving) :], log_total


def backward_step(
    before: Joint,
    backward: Joint,
    leaving: Joint,
    audio: LoopTransitions,
    visual: LoopTransitions,
    density: FrameDensity,
) -> BackwardStep:
    """Return the result of a step back.

    before   : forward probabilities of the frame before
    backward : backward probabilities times densities of this frame
    leaving  : as ``forward_step`` returned it for ``before``
    density  : of the frame before
    """
    units_audio, units_visual = len(audio.leaving), len(visual.leaving)
    moved = visual.backward(backward.T).T
    beta = audio.backward(moved)
    frame = frame_posteriors(before, beta, density)
    scale = 1 / (frame.overlap * WHOLE[before.dtype] ** 2) if frame.overlap > 0 else 0.0
    audio_entered = before[-units_audio:] @ moved[:units_audio].T
    visual_entered = leaving.T @ backward[:, :units_visual]
    return BackwardStep(
        frame,
        times_density(beta, density, before.dtype)[0],
        np.float64(scale) * audio_entered,
        np.float64(scale) * visual_entered,
    )


def frame_posteriors(forward: Joint, backward: Joint, density: FrameDensity) -> FramePosteriors:
    """Return the posteriors of a frame from its forward and backward probabilities."""
    joint = np.multiply(forward, backward, dtype=np.float64)
    total = float(joint.sum())
    joint /= total if total > 0 else 1
    return FramePosteriors(
        joint.sum(axis=1),
        joint.sum(axis=0),
        joint[density.pair_audio, density.pair_visual],
        total / WHOLE[forward.dtype] ** 2,
    )


def times_density(
    prior: NDArray[np.float64], density: FrameDensity, kind: np.dtype[np.floating[Any]]
) -> tuple[Joint, float]:
    """Return probabilities times densities, normalised, in the precision ``kind``, and the log of their sum before.

    prior : in double precision, as shares of the whole of ``kind``
    Where all products are 0, the sum's logarithm is -inf, and the probabilities have no meaning.
    """
    whole = WHOLE[kind]
    joint = prior * density.audio[:, None] * density.visual
    joint[density.pair_audio, density.pair_visual] = prior[density.pair_audio, density.pair_visual] * density.pair
    total, log_best = float(joint.sum()), density.best
    if not total > LEAST_TOTAL * whole:
        joint, log_best = _times_density_from_logs(prior, density)
        total = float(joint.sum())
    if not total > 0:
        return np.zeros(joint.shape, kind), -np.inf
    return np.maximum(joint * (whole / total), 1 / whole).astype(kind), float(np.log(total / whole)) + log_best


def _times_density_from_logs(prior: NDArray[np.float64], density: FrameDensity) -> tuple[NDArray[np.float64], float]:
    """Return probabilities times densities relative to the greatest product, and its logarithm."""
    audio, visual, pair = density.logs
    joint = np.add.outer(audio, visual, dtype=np.float64)
    joint[density.pair_audio, density.pair_visual] = pair
    with np.errstate(divide="ignore"):
        joint += np.log(prior)
    best = float(joint.max())
    return (np.exp(joint - best), best) if np.isfinite(best) else (np.zeros_like(prior), 0.0)
