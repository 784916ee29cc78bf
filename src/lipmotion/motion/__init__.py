"""Parts that all engines share: motion space, acoustic context, closures, variance scaling, parameter generation.

An engine of your own needs ``fit_motion``, ``LearnedMotion`` and perhaps ``fit_acoustic_context``
(docs/extend/engine.md).
"""

from lipmotion.motion.arrays import LEARNED_MOTION_ARRAYS, learned_motion_from_arrays, learned_motion_to_arrays
from lipmotion.motion.context_window import (
    WINDOW,
    AcousticContext,
    acoustic_context_from_arrays,
    acoustic_context_to_arrays,
    fit_acoustic_context,
)
from lipmotion.motion.frame_labels import with_unit_names
from lipmotion.motion.generation import LearnedMotion, fit_motion
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics

__all__ = [
    "LEARNED_MOTION_ARRAYS", "WINDOW", "AcousticContext", "LearnedMotion", "acoustic_context_from_arrays",
    "acoustic_context_to_arrays", "fit_acoustic_context", "fit_motion", "learned_motion_from_arrays",
    "learned_motion_to_arrays", "mark_known_dynamics", "with_dynamics", "with_unit_names",
]  # fmt: skip
