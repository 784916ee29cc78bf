"""Curves of a whole face: ARKit's mouth from the motion, and the eyes, brows and head of the faces that are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.base import Staging
from lipmotion.types import Channel, Motion, Prosody, Timeline, Unit
from lipmotion.types.motion import WEIGHT

if TYPE_CHECKING:
    from lipmotion.faces.character.pose import CharacterPose

RADIAN = "radian"
"""The unit of the angles of a head."""
HEAD = ("headYaw", "headPitch", "headRoll")
"""Angles of the head in radians: to its left, up, and to its left shoulder."""


def living_curves(
    motion: Motion, units: Timeline[Unit], staging: Staging | None = None, prosody: Prosody | None = None
) -> Motion:
    """Return blinks, gaze, brows and the head's angles at the frames of a motion, by ARKit's names.

    staging : seed, and what moves on its own; None: everything moves
    prosody : of the speech, for accents of brows and head; None: they follow the opening
    They are those of the 3D head with the same seed. Channels are blendshapes (weights), and ``HEAD`` in radians.
    Raises InputError: the motion has no channel ``opening``.
    """
    from lipmotion.faces.character import staged_pose
    from lipmotion.faces.character.performance import head_poses
    from lipmotion.faces.liveliness import SEED

    chosen = staging or Staging()
    poses = head_poses(motion, units, motion.rate_hz, seed=SEED + chosen.seed, prosody=prosody)
    return curves_of_poses([staged_pose(pose, chosen) for pose in poses], motion.rate_hz)


def curves_of_poses(staged: Sequence[CharacterPose], rate_hz: float) -> Motion:
    """Return blinks, gaze, brows and the head's angles in poses, one a frame, as ``living_curves`` does."""
    from lipmotion.faces.character.shapes import BROWS_UP, EYE_ACROSS, EYE_UPWARDS

    gaze = np.array([pose.gaze for pose in staged]).reshape(-1, 2)
    turn = np.array([pose.turn for pose in staged]).reshape(-1, 3)
    shut, brows = (np.array([getattr(pose, name) for pose in staged]) for name in ("shut", "brows"))
    raised = _weight(brows / BROWS_UP)
    curves: dict[str, NDArray[np.float64]] = {}
    for side, outward in (("Left", 1.0), ("Right", -1.0)):
        curves[f"eyeBlink{side}"] = _weight(shut)
        curves[f"eyeLookOut{side}"] = _weight(outward * gaze[:, 0] / EYE_ACROSS)
        curves[f"eyeLookIn{side}"] = _weight(-outward * gaze[:, 0] / EYE_ACROSS)
        curves[f"eyeLookUp{side}"] = _weight(gaze[:, 1] / EYE_UPWARDS)
        curves[f"eyeLookDown{side}"] = _weight(-gaze[:, 1] / EYE_UPWARDS)
        curves[f"browOuterUp{side}"] = 0.5 * raised
    curves["browInnerUp"] = raised
    curves |= dict(zip(HEAD, turn.T, strict=True))
    channels = tuple(Channel(name, RADIAN if name in HEAD else WEIGHT) for name in curves)
    return Motion(np.stack(list(curves.values()), axis=1), rate_hz, channels)


def _weight(curve: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.clip(curve, 0.0, 1.0)
