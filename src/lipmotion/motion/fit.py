"""Training of what all engines learn of motion beside their statistics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.closure import fit_closure_of
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.limits import limits_of
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.types import Example


def fit_motion(examples: Sequence[Example], components: int) -> tuple[LearnedMotion, list[NDArray[np.float64]]]:
    """Return the learned motion of some examples, and the motion of each in its space [each shape=(T, Q)].

    components : principal components that all point channels are reduced to
    Limits are those of the valid frames; movements are not scaled.
    Raises CorpusError: no example has valid motion, or the examples have different channels.
    """
    space, values = fit_reduced_motion(examples, components)
    closure = fit_closure_of(space.direct_names, values, examples)
    valid = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    return LearnedMotion(space, closure, limits_of(valid)), values
