"""Curves of what moves beside the mouth: eyes and brows as ARKit's blendshapes, and the angles of the head."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness, compute_liveliness
from lipmotion.meshes.fitting.eyes_and_brows import (
    MOVED_BY,
    eye_and_brow_weights,
    find_movements,
    moves_by_itself,
    with_movements,
)
from lipmotion.meshes.model.head_angles import ANGLES
from lipmotion.types import Channel, Motion, Prosody, Timeline, Unit
from lipmotion.types.motion import RADIAN, WEIGHT
from lipmotion.types.staging import Staging


def compute_living_curves(
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
    moved = stage_liveliness(motion.time_s[frames], motion, units, staging, prosody)
    curves = eye_and_brow_weights(moved) | dict(zip(ANGLES, moved.turn.T, strict=True))
    channels = tuple(Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in curves)
    return Motion(np.stack(list(curves.values()), axis=1), motion.rate_hz, channels)


def stage_liveliness(
    time_s: NDArray[np.float64],
    motion: Motion,
    units: Timeline[Unit],
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> Liveliness:
    """Return what moves beside the mouth at some times, as a staging asks for it; None: everything moves.

    motion, units, prosody : as of ``articulation.liveliness``; blinks, gaze, brows and angles of the head that the
                             motion itself has take the place of what would move on its own
    """
    chosen, given = staging or Staging(), find_movements(motion, time_s)
    moving = {part: getattr(chosen, part) and moves_by_itself(part, given) for part in MOVED_BY}
    return with_movements(compute_liveliness(time_s, motion, units, prosody, seed=chosen.seed, **moving), given)
