"""Forward–backward of a factorial hidden Markov model in logarithms: slow, and exact however improbable a path is.

``factorial`` turns to it where probabilities that are needed later are too small, relative to those of other joint
states in the same frame, for numbers of double precision.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np

from lipmotion.kernels.sequences.factorial_steps import FramePosteriors
from lipmotion.kernels.sequences.loops import Array, FactorialLogLikelihoods, Loop

TransitionsT = TypeVar("TransitionsT", bound="LogTransitions")
LARGEST_EXPONENT = 700.0
"""Expected transitions are divided by the probability of the transition: the quotient must stay finite."""


class LogStep(NamedTuple):
    """The result of a step back to the frame before, as ``factorial_steps.BackwardStep``.

    backward : log backward probabilities plus log densities [shape=(Na, Nv)]
    """

    frame: FramePosteriors
    backward: Array
    audio_entered: Array
    visual_entered: Array


class LogTransitions(NamedTuple):
    """Log transition probabilities of a loop, as ``loops.LoopTransitions``."""

    stay: Array
    onward: Array
    leaving: Array

    @classmethod
    def of(cls: type[TransitionsT], loop: Loop) -> TransitionsT:
        """Return the transitions of a loop."""
        with np.errstate(divide="ignore"):
            leaving = np.log(loop.leave)[:, None] + np.log(loop.enter)
            return cls(np.log(loop.stay.ravel()), np.log(loop.onward.ravel()), leaving)

    def forward(self, joint: Array) -> Array:
        """Return log probabilities one frame on, along axis 0 [shape=(N, M)]."""
        units = len(self.leaving)
        after = joint + self.stay[:, None]
        after[units:] = np.logaddexp(after[units:], joint[:-units] + self.onward[:, None])
        entering = np.logaddexp.reduce(joint[-units:, None] + self.leaving[:, :, None], axis=0)
        after[:units] = np.logaddexp(after[:units], entering)
        return after

    def backward(self, joint: Array) -> Array:
        """Return log backward probabilities one frame back, along axis 0 [shape=(N, M)]."""
        units = len(self.leaving)
        before = joint + self.stay[:, None]
        before[:-units] = np.logaddexp(before[:-units], joint[units:] + self.onward[:, None])
        left = np.logaddexp.reduce(joint[None, :units] + self.leaving[:, :, None], axis=1)
        before[-units:] = np.logaddexp(before[-units:], left)
        return before


class LogForwardBackward(NamedTuple):
    """Forward and backward steps of one recording in logarithms."""

    audio: LogTransitions
    visual: LogTransitions
    logs: FactorialLogLikelihoods

    @classmethod
    def of(cls, audio: Loop, visual: Loop, logs: FactorialLogLikelihoods) -> LogForwardBackward:
        """Return the steps of a recording in two loops."""
        return cls(LogTransitions.of(audio), LogTransitions.of(visual), logs)

    def forward(self, before: Array, t: int) -> Array:
        """Return the log forward probabilities of frame ``t`` from those of the frame before [shape=(Na, Nv)]."""
        return self.visual.forward(self.audio.forward(before).T).T + self.logs.joint(t)

    def frame(self, forward: Array, backward: Array) -> FramePosteriors:
        """Return the posteriors of a frame; its overlap is a logarithm."""
        joint = forward + backward
        log_overlap = float(np.logaddexp.reduce(joint, axis=None))
        joint = np.exp(joint - log_overlap) if math.isfinite(log_overlap) else np.zeros_like(joint)
        return FramePosteriors(joint.sum(axis=1), joint.sum(axis=0), joint[tuple(self.logs.pairs.T)], log_overlap)

    def back(self, before: Array, backward: Array, t: int) -> LogStep:
        """Return the result of a step from frame ``t`` + 1 back to frame ``t``.

        before   : log forward probabilities of frame ``t``
        backward : log backward probabilities plus log densities of frame ``t`` + 1
        """
        units_audio, units_visual = len(self.audio.leaving), len(self.visual.leaving)
        moved = self.visual.backward(backward.T).T
        beta = self.audio.backward(moved)
        frame = self.frame(before, beta)
        audio_entered = np.logaddexp.reduce(before[-units_audio:, None] + moved[None, :units_audio], axis=2)
        leaving = self.audio.forward(before)[:, -units_visual:]
        visual_entered = np.logaddexp.reduce(leaving[:, :, None] + backward[:, None, :units_visual], axis=0)
        entered = (
            np.exp(np.minimum(logs - frame.overlap, LARGEST_EXPONENT)) for logs in (audio_entered, visual_entered)
        )
        return LogStep(frame, beta + self.logs.joint(t), *entered)
