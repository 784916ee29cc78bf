"""What a character does beside speaking: blinks, glances, brows, and the head, as the drawn faces do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.base import Staging
from lipmotion.faces.liveliness import SEED, accent_of, liveliness
from lipmotion.motion.gestures import pause_curve
from lipmotion.rig.point_motion import point_motion
from lipmotion.types import Motion, Prosody, Timeline, Unit

Array = NDArray[np.float64]

FULL_LOOK = 0.55
"""ARKit's blendshapes of looking turn the eyes so far at weight 1, in radians."""
FULL_BROWS, MOST_BROWS = 0.07, 0.6
"""Brows are raised so far at weight 1, in eye distances; and their largest weight."""


class MeshPerformance(NamedTuple):
    """Movements of a character at the times of its pictures.

    weights : of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(T,)]
    turn    : of the head to the character's left, upwards and to the left shoulder, in radians [shape=(T, 3)]
    gaze    : of the eyes against the head, to the left and upwards, in radians [shape=(T, 2)]
    """

    weights: dict[str, Array]
    turn: Array
    gaze: Array


def mesh_performance(
    motion: Motion, units: Timeline[Unit], time_s: Array, staging: Staging, prosody: Prosody | None = None
) -> MeshPerformance:
    """Return the movements at some times in seconds, evenly spaced; what the staging switches off is 0.

    prosody : of the speech, for accents of brows and head; None: they follow the opening of the mouth
    Raises InputError: as ``point_motion``.
    """
    fps = 1 / float(time_s[1] - time_s[0]) if len(time_s) > 1 else 25.0
    opening = np.interp(time_s, motion.time_s, point_motion(motion, units).gap)
    pause = pause_curve(units, time_s)
    alive = liveliness(opening, pause, fps, seed=SEED + staging.seed, accent=accent_of(prosody, time_s))
    turn = alive.turn if staging.head else np.zeros_like(alive.turn)
    gaze = alive.gaze if staging.gaze else -0.85 * alive.turn[:, :2]
    if not staging.head:  # eyes that hold their target turn against the head
        gaze = gaze + 0.85 * alive.turn[:, :2]
    weights: dict[str, Array] = {}
    if staging.blinks:
        weights |= dict.fromkeys(("eyeBlinkLeft", "eyeBlinkRight"), alive.shut)
    if staging.brows:
        raised = np.clip(alive.brows / FULL_BROWS, 0, MOST_BROWS)
        weights |= dict.fromkeys(("browInnerUp", "browOuterUpLeft", "browOuterUpRight"), raised)
    left, right = (np.clip(side * gaze[:, 0] / FULL_LOOK, 0, 1) for side in (1, -1))
    up, down = (np.clip(side * gaze[:, 1] / FULL_LOOK, 0, 1) for side in (1, -1))
    weights |= {"eyeLookOutLeft": left, "eyeLookInRight": left, "eyeLookInLeft": right, "eyeLookOutRight": right}
    weights |= {f"eyeLookUp{side}": up for side in ("Left", "Right")}
    weights |= {f"eyeLookDown{side}": down for side in ("Left", "Right")}
    return MeshPerformance(weights, turn, gaze)
