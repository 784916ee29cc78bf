"""A motion of weights for writers of curves."""

from __future__ import annotations

import numpy as np

from lipmotion.types import WEIGHT, Channel, Generation, Motion, StateTrace, Timeline


def generation(*names: str, rate_hz: float = 30.0, frames: int = 31, stepped: tuple[str, ...] = ()) -> Generation:
    """Weights that rest for ten frames, then move; angles of the head, where their names are among them."""
    values = np.random.default_rng(5).random((frames, len(names)))
    values[:10] = 0.25
    for column, name in enumerate(names):
        if name in stepped:
            values[:, column] = np.repeat([0.25, 0.75, 0.5], [10, 10, frames - 20])
        if name.startswith("head"):
            values[:, column] -= 0.5
    channels = tuple(Channel(name, "radian" if name.startswith("head") else WEIGHT) for name in names)
    trace = StateTrace(("a",), np.zeros(frames, np.intp))
    return Generation(Motion(values, rate_hz, channels), values, Timeline(()), trace, stepped=stepped)
