"""One frame of a factorial hidden Markov model as in ``factorial_steps``, compiled but for products of matrices."""

from __future__ import annotations

import math

import numpy as np

from lipmotion.kernels import factorial_steps
from lipmotion.kernels.compiled import factorial
from lipmotion.kernels.factorial_steps import BackwardStep, FramePosteriors, Joint
from lipmotion.kernels.loops import FrameDensity, LoopTransitions

LEAST = {np.dtype(np.float32): (1e-37, 1e-30), np.dtype(np.float64): (1e-140, 1e-140)}
"""By precision: smaller products, and smaller shares of a frame, are set to 0."""


def forward_step(
    before: Joint, audio: LoopTransitions, visual: LoopTransitions, density: FrameDensity
) -> tuple[Joint, Joint, float]:
    """Return the result of ``factorial_steps.forward_step``."""
    entering = audio.leaving.T @ before[-len(audio.leaving) :]
    moved = factorial.moved_to_last(before, audio.stay, audio.onward, entering, len(visual.leaving))
    after = np.empty_like(before)
    total = factorial.forward(
        before, audio.stay, audio.onward, entering, visual.stay, visual.onward, moved @ visual.leaving,
        density.audio, density.visual, density.pair_audio, density.pair_visual, density.pair, *LEAST[before.dtype],
        after,
    )  # fmt: skip
    if total > 0:
        return after, moved, math.log(total) + density.best
    return factorial_steps.forward_step(before, audio, visual, density)


def backward_step(
    before: Joint,
    backward: Joint,
    leaving: Joint,
    audio: LoopTransitions,
    visual: LoopTransitions,
    density: FrameDensity,
) -> BackwardStep:
    """Return the result of ``factorial_steps.backward_step``."""
    units, first = len(audio.leaving), backward[:, : len(visual.leaving)]
    moved = factorial.moved_back(backward, visual.stay, visual.onward, first @ visual.leaving.T)
    after = np.empty_like(before)
    by_audio, by_visual, by_pair = np.empty(before.shape[0]), np.empty(before.shape[1]), np.empty(len(density.pair))
    total = factorial.backward(
        before, moved, audio.stay, audio.onward, audio.leaving @ moved[:units],
        density.audio, density.visual, density.pair_audio, density.pair_visual, density.pair, *LEAST[before.dtype],
        after, by_audio, by_visual, by_pair,
    )  # fmt: skip
    overlap = float(by_audio.sum())
    if not (total > 0 and overlap > 0):
        return factorial_steps.backward_step(before, backward, leaving, audio, visual, density)
    scale = 1 / overlap
    frame = FramePosteriors(by_audio * scale, by_visual * scale, by_pair * scale, overlap)
    audio_entered, visual_entered = before[-units:] @ moved[:units].T, leaving.T @ first
    return BackwardStep(frame, after, np.float64(scale) * audio_entered, np.float64(scale) * visual_entered)
