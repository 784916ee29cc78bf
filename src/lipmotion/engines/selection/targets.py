"""Speech as the target of a selection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.guide import at_points
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.windows import covering, phone_windows
from lipmotion.motion.acoustic_network import AcousticNetwork
from lipmotion.types import FRAME_RATE_HZ, Speech


def target_of(
    model: SelectionModel, costs: Costs, speech: Speech, guiding: NDArray[np.float64] | None = None
) -> Target:
    """Return the phones of speech, with the motion that the guide predicts from its sound.

    guiding : motion in the motion space, as wide as recorded motion, that guides instead of the prediction
              [shape=(T, Q)]; what is ``heard`` is still the model's own prediction. None: the prediction guides
    Raises InputError: an unknown phone.
    """
    frames = len(speech.features.values)
    windows = phone_windows([covering(speech.units, (frames - 1) / FRAME_RATE_HZ)])
    guide = model.guide
    if guide is None or (isinstance(guide.predictor, AcousticNetwork) and speech.spectrum is None):
        return costs.target(windows, None, None)
    predicted = at_points(guide.predict(speech), windows)
    guided = guide.expanded(predicted) if guiding is None else at_points(guiding, windows)
    return costs.target(windows, guided, predicted)
