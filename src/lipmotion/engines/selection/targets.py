"""Speech as the target of a selection."""

from __future__ import annotations

from lipmotion.engines.selection.costs import Costs, Target
from lipmotion.engines.selection.guide import at_points
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.windows import covering, phone_windows
from lipmotion.motion.acoustic_network import AcousticNetwork
from lipmotion.types import FRAME_RATE_HZ, Speech


def target_of(model: SelectionModel, costs: Costs, speech: Speech) -> Target:
    """Return the phones of speech, with the motion that the guide predicts from its sound.

    Raises InputError: an unknown phone.
    """
    frames = len(speech.features.values)
    windows = phone_windows([covering(speech.units, (frames - 1) / FRAME_RATE_HZ)])
    guide = model.guide
    if guide is None or (isinstance(guide.predictor, AcousticNetwork) and speech.spectrum is None):
        return costs.target(windows, None, None)
    predicted = at_points(guide.predict(speech), windows)
    return costs.target(windows, guide.expanded(predicted), predicted)
