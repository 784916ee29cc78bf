"""Blinks, glances and raised brows as weights of ARKit's blendshapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness

Array = NDArray[np.float64]

FULL_LOOK_RAD = 0.55
"""ARKit's blendshapes of looking turn the eyes so far at weight 1, in radians."""
FULL_BROW_RISE = 0.08
"""Brows are raised so far at weight 1, in eye distances."""
OUTER_BROW_SHARE = 0.6
"""The outer ends of the brows rise by this part of the weight of the inner ends."""


def eye_and_brow_weights(moved: Liveliness) -> dict[str, Array]:
    """Return the weights of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(F,)]."""
    across, upwards = moved.gaze.T
    raised = np.clip(moved.brows / FULL_BROW_RISE, 0, 1)
    weights: dict[str, Array] = {}
    for side, outward in (("Left", 1.0), ("Right", -1.0)):
        weights[f"eyeBlink{side}"] = np.clip(moved.lids, 0, 1)
        weights[f"eyeLookOut{side}"] = np.clip(outward * across / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookIn{side}"] = np.clip(-outward * across / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookUp{side}"] = np.clip(upwards / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookDown{side}"] = np.clip(-upwards / FULL_LOOK_RAD, 0, 1)
        weights[f"browOuterUp{side}"] = OUTER_BROW_SHARE * raised
    weights["browInnerUp"] = raised
    return weights
