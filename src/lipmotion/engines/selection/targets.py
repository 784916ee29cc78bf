"""Speech as the target of a selection."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.guide import at_points
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.windows import covering, phone_windows
from lipmotion.motion.reliability import phone_reliability
from lipmotion.types import FRAME_RATE_HZ, Span, Speech, Timeline, Unit
from lipmotion.units import SILENCE

SEGMENT_S = 0.1
"""Duration of the segments of speech whose phones cannot be relied on."""
LEAST_RELIABILITY = 0.5
"""Mean reliability of the phones from which on they choose."""


def target_of(model: SelectionModel, costs: Costs, speech: Speech) -> Target:
    """Return the phones of speech, with the motion that the guide predicts from its sound.

    Where noise makes the recognised phones of a recording unreliable on the whole, the target is segments of equal
    duration, for which the sound alone chooses.
    Raises InputError: an unknown phone.
    """
    frames = len(speech.features.values)
    duration_s = (frames - 1) / FRAME_RATE_HZ
    units, guide = covering(speech.units, duration_s), model.guide
    if guide is None or not guide.predictor.can_predict(speech) or not costs.config.guide:
        return costs.target(costs.shown(phone_windows([units])), None, None)
    motion, distortion = guide.predict(speech)
    by_sound = bool(phone_reliability(speech, distortion, frames).mean() < LEAST_RELIABILITY)
    windows = phone_windows([_segments(duration_s)]) if by_sound else costs.shown(phone_windows([units]))
    predicted = at_points(motion, windows.times_s)
    return costs.target(windows, guide.expanded(predicted), predicted, by_sound=by_sound)


def _segments(duration_s: float) -> Timeline[Unit]:
    """Return segments of equal duration; their phone is not used."""
    edges = np.linspace(0, duration_s, max(round(duration_s / SEGMENT_S), 1) + 1).tolist()
    return Timeline(tuple(Span(a, b, Unit(SILENCE)) for a, b in pairwise(edges)))
