"""Training of the motion space, the closures and the limits of motion: the same for all engines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.articulation import fit_articulation_prior
from lipmotion.motion.closure import fit_closure
from lipmotion.motion.generation import LearnedMotion
from lipmotion.motion.limits import measure_limits
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.types import Example


def fit_motion(examples: Sequence[Example], components: int) -> tuple[LearnedMotion, list[NDArray[np.float64]]]:
    """Return the learned motion of some examples, and the motion of each in the motion space [each shape=(T, Q)].

    components : principal components that all point channels are reduced to
    The limits are the extremes of the valid frames; there is no variance scaling.
    Raises CorpusError: no example has valid motion, or the examples have different channels.
    """
    space, values = fit_reduced_motion(examples, components)
    closure = fit_closure(space.direct_names, values, examples)
    valid = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    return LearnedMotion(
        space, closure, measure_limits(valid), prior=fit_articulation_prior(space, values, examples)
    ), values
