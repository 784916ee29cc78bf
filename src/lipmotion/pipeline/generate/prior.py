"""Models that stand on another model: what that model makes of the same speech."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from lipmotion.motion.articulation import ARTICULATORS, measured_articulators
from lipmotion.motion.network_steps import STEP
from lipmotion.types import PriorOutput, Speech

if TYPE_CHECKING:
    from lipmotion.pipeline.model import Model


def with_prior(prior: Model | None, speech: Speech) -> Speech:
    """Return speech with what another model makes of it; the same speech if there is no other model.

    The closures that the other engine would force are left to the engine that stands on it.
    """
    if prior is None:
        return speech
    if speech.parts is not None:
        parts = tuple(part._replace(speech=with_prior(prior, part.speech)) for part in speech.parts)
        speech = replace(speech, parts=parts)
    whole = speech.with_arrays()
    motion = prior.engine.without_closures().generate(prior.learned, whole).motion
    measured = measured_articulators(motion.values, motion.names)
    chosen = [measured[name][::STEP] for name in ARTICULATORS if name in measured]
    steps = len(motion.values[::STEP])
    nothing = np.zeros((steps, 0), np.float32), np.zeros(steps)
    hidden, distortion = prior.engine.hidden(prior.learned, whole) or nothing
    articulators = np.stack(chosen, axis=1) if chosen else np.zeros((steps, 0))
    return replace(speech, prior=PriorOutput(articulators, hidden, distortion))
