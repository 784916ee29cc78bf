"""Curves of what moves beside the mouth: eyes and brows as ARKit's blendshapes, and the angles of the head."""

from __future__ import annotations

import numpy as np

from lipmotion.faces.base import Staging, alive
from lipmotion.meshes.fitting.eyes_and_brows import eye_and_brow_weights
from lipmotion.meshes.model.head_angles import ANGLES
from lipmotion.types import Channel, Motion, Prosody, Timeline, Unit
from lipmotion.types.motion import RADIAN, WEIGHT


def living_curves(
    motion: Motion,
    units: Timeline[Unit],
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    frames: slice = slice(None),
) -> Motion:
    """Return blinks, gaze, brows and the head's angles at the frames of a motion, by ARKit's names.

    motion  : needs ``opening`` where the prosody is not known
    staging : seed, and what moves on its own; None: everything moves
    prosody : of the speech, for accents of brows and head; None: they follow the opening
    frames  : those that are wanted
    They are those of all faces with the same seed. Channels are blendshapes (weights), and ``ANGLES`` in radians.
    """
    moved = alive(motion.time_s[frames], motion, units, staging, prosody)
    curves = eye_and_brow_weights(moved) | dict(zip(ANGLES, moved.turn.T, strict=True))
    channels = tuple(Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in curves)
    return Motion(np.stack(list(curves.values()), axis=1), motion.rate_hz, channels)
