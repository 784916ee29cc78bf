"""One frame of a factorial hidden Markov model as in ``factorial_steps``, compiled but for products of matrices."""

from __future__ import annotations

import math

import numpy as np

from lipmotion.kernels.compiled import factorial
from lipmotion.kernels.sequences import factorial_steps
from lipmotion.kernels.sequences.factorial_steps import WHOLE, BackwardStep, FramePosteriors, Joint
from lipmotion.kernels.sequences.loops import FrameDensity, LoopTransitions

LEAST_PRODUCT = {np.dtype(np.float32): 1e-37, np.dtype(np.float64): 1e-300}
"""By precision: smaller products of probabilities and densities are set to 0."""
LEAST_TOTAL = {np.dtype(np.float32): 1e-20, np.dtype(np.float64): 1e-150}
"""By precision: least sum of these products, as a share of the whole. With such a sum, what was set to 0 or underflowed
is less than what probabilities are raised to; with a smaller one, double precision computes products in logarithms."""


def forward_step(
    before: Joint, audio: LoopTransitions, visual: LoopTransitions, density: FrameDensity
) -> tuple[Joint, Joint, float]:
    """Return the result of ``factorial_steps.forward_step``; in single precision -inf where that is not enough."""
    entering = audio.leaving.T @ before[-len(audio.leaving) :]
    moved = factorial.moved_to_last(before, audio.stay, audio.onward, entering, len(visual.leaving))
    after = np.empty_like(before)
    total = factorial.forward(
        before, audio.stay, audio.onward, entering, visual.stay, visual.onward, moved @ visual.leaving,
        density.audio, density.visual, density.pair_audio, density.pair_visual, density.pair,
        LEAST_PRODUCT[before.dtype], WHOLE[before.dtype], after,
    )  # fmt: skip
    if total > LEAST_TOTAL[before.dtype]:
        return after, moved, math.log(total) + density.best
    if before.dtype == np.float32:
        return after, moved, -math.inf
    return factorial_steps.forward_step(before, audio, visual, density)


def backward_step(
    before: Joint,
    backward: Joint,
    leaving: Joint,
    audio: LoopTransitions,
    visual: LoopTransitions,
    density: FrameDensity,
) -> BackwardStep:
    """Return the result of ``factorial_steps.backward_step``; in single precision an overlap of 0 where that is not
    enough.
    """
    units, first = len(audio.leaving), backward[:, : len(visual.leaving)]
    moved = factorial.moved_back(backward, visual.stay, visual.onward, first @ visual.leaving.T)
    after = np.empty_like(before)
    by_audio, by_visual, by_pair = np.empty(before.shape[0]), np.empty(before.shape[1]), np.empty(len(density.pair))
    total = factorial.backward(
        before, moved, audio.stay, audio.onward, audio.leaving @ moved[:units],
        density.audio, density.visual, density.pair_audio, density.pair_visual, density.pair,
        LEAST_PRODUCT[before.dtype], WHOLE[before.dtype], after, by_audio, by_visual, by_pair,
    )  # fmt: skip
    enough = total > LEAST_TOTAL[before.dtype]
    if not enough and before.dtype == np.float64:
        return factorial_steps.backward_step(before, backward, leaving, audio, visual, density)
    met = float(by_audio.sum())
    scale = 1 / met if met > 0 else 0.0
    overlap = met / WHOLE[before.dtype] ** 2 if enough else 0.0
    frame = FramePosteriors(by_audio * scale, by_visual * scale, by_pair * scale, overlap)
    audio_entered, visual_entered = before[-units:] @ moved[:units].T, leaving.T @ first
    return BackwardStep(frame, after, np.float64(scale) * audio_entered, np.float64(scale) * visual_entered)
