"""How far training knows a voice, as it counts for motion."""

from __future__ import annotations

import numpy as np


def strangeness(voice: float) -> float:
    """Return how far the measures for unknown voices apply, 0 to 1; more than half for voices half known."""
    return float(np.sqrt(1 - voice))
