"""What all engines share: the space of motion, the acoustic context, closures, scaling, parameter generation.

For an engine of your own (docs/extend/engine.md): ``fit_motion``, ``LearnedMotion``, ``fit_acoustic_context``.
"""

from lipmotion.motion.arrays import LEARNED_MOTION_ARRAYS, learned_motion_arrays, learned_motion_from_arrays
from lipmotion.motion.context_window import (
    WINDOW,
    AcousticContext,
    acoustic_context_arrays,
    acoustic_context_from,
    fit_acoustic_context,
)
from lipmotion.motion.fit import fit_motion
from lipmotion.motion.frame_labels import with_unit_names
from lipmotion.motion.generation import LearnedMotion

__all__ = [
    "LEARNED_MOTION_ARRAYS",
    "WINDOW",
    "AcousticContext",
    "LearnedMotion",
    "acoustic_context_arrays",
    "acoustic_context_from",
    "fit_acoustic_context",
    "fit_motion",
    "learned_motion_arrays",
    "learned_motion_from_arrays",
    "with_unit_names",
]
