"""Blinks, glances, brows, and what moods do to the upper face, as weights of ARKit's blendshapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness

Array = NDArray[np.float64]

FULL_LOOK_RAD = 0.55
"""ARKit's blendshapes of looking turn the eyes so far at weight 1, in radians."""
FULL_BROW_RISE = 0.08
"""Brows are raised so far at weight 1, in eye distances."""
CHEEK_SQUINT = 0.6
"""Raised cheeks narrow the eyes by this part of their weight."""
OUTER_BROW_SHARE = 0.6
"""The outer ends of the brows rise by this part of the weight of the inner ends."""


def eye_and_brow_weights(moved: Liveliness) -> dict[str, Array]:
    """Return the weights of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(F,)]."""
    across, upwards = moved.gaze.T
    raised = np.clip(moved.brows / FULL_BROW_RISE, 0, 1)
    moods = _of_moods(moved) if moved.units else {}
    weights: dict[str, Array] = {}
    for side, outward in (("Left", 1.0), ("Right", -1.0)):
        weights[f"eyeBlink{side}"] = np.clip(moved.lids, 0, 1)
        weights[f"eyeLookOut{side}"] = np.clip(outward * across / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookIn{side}"] = np.clip(-outward * across / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookUp{side}"] = np.clip(upwards / FULL_LOOK_RAD, 0, 1)
        weights[f"eyeLookDown{side}"] = np.clip(-upwards / FULL_LOOK_RAD, 0, 1)
        weights[f"browOuterUp{side}"] = np.clip(OUTER_BROW_SHARE * raised + moved.unit(2), 0, 1)
        weights |= {f"{name}{side}": curve for name, curve in moods.items()}
    weights["browInnerUp"] = np.clip(raised + moved.unit(1), 0, 1)
    return weights


def _of_moods(moved: Liveliness) -> dict[str, Array]:
    """Return the weights of shapes, one each for both sides, that a mood alone moves [each shape=(F,)]."""
    return {
        "browDown": moved.unit(4),
        "eyeWide": moved.unit(5),
        "cheekSquint": moved.unit(6),
        "eyeSquint": np.maximum(moved.unit(7), CHEEK_SQUINT * moved.unit(6)),
        "noseSneer": moved.unit(9),
    }
