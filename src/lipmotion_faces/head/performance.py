"""Poses of the head from the spoken mouth and what moves beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness
from lipmotion.articulation.mouth import SpokenMouth, spoken_mouth, upper_share
from lipmotion.articulation.phone_targets import TIP_UP
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import Staging, stage_liveliness
from lipmotion_faces.head.pose import CharacterPose

Curve = NDArray[np.float64]

SPREAD_RISE = 0.52
"""Part of the gap by which the upper lip rises where lips are spread: the upper teeth show more than the lower ones."""
BITTEN_GAP = (0.12, 0.2)
"""Teeth stay together up to the first gap, and part until the second one."""
BITTEN = (0.8, 0.95)
"""Teeth are apart up to the first value of ``teeth``, and together from the second on."""
OO_ROUNDNESS = 0.8
"""How round the lips of oo are; those of w are a ring."""
MOOD_SMILE, MOOD_FROWN, MOOD_TIGHT, RAISED_LIP = 0.065, 0.07, 0.025, 0.06
"""How far a mood raises the corners, lowers them, lowers those of tight, stretched or raised lips, and raises the upper
lip."""
FULL_NARROWING, FULL_WIDENING = 0.16, 0.12
"""Changes of width at which lips are round, and spread, whatever the phones ask for."""


def head_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging | None = None, prosody: Prosody | None = None
) -> list[CharacterPose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds, to the end of the motion.

    staging : seed, and what moves on its own; None: everything moves
    prosody : of the speech, for accents of brows and head; None: they follow the opening
    Raises InputError: as ``spoken_mouth``.
    """
    mouth = spoken_mouth(motion, units, fps)
    return posed(mouth, stage_liveliness(np.arange(len(mouth.gap)) / fps, motion, units, staging, prosody))


def posed(mouth: SpokenMouth, moved: Liveliness) -> list[CharacterPose]:
    """Return the poses that show a mouth, and eyes, brows and head, one a frame."""
    mouth = mouth.with_corners(moved.unit(12), moved.unit(15))
    gap, change = mouth.gap, mouth.width - 1
    spread = mouth.spread * (1 - mouth.protrusion)
    roundness = np.maximum(mouth.protrusion, 0.4 * np.clip(-change / FULL_NARROWING, 0, 1) * (1 - spread))
    wide = np.clip(np.maximum(spread, np.clip(change / FULL_WIDENING, 0, 1)) - roundness, 0, 1)
    together = np.clip((BITTEN_GAP[1] - gap) / np.ptp(BITTEN_GAP), 0, 1)
    teeth = np.clip((mouth.teeth - BITTEN[0]) / (BITTEN[1] - BITTEN[0]), 0, 1)
    bite = np.maximum(teeth, 0.5 * spread) * together
    closing, out = mouth.closing, mouth.between_teeth * (1 - mouth.closing)
    serious = np.maximum(np.maximum(mouth.tight, mouth.stretched), mouth.upper_raise)
    curves = {
        "gap": gap,
        "upper_rise": _rise(gap, roundness, np.maximum(wide, 0.9 * teeth), mouth.tuck, mouth.upper_raise),
        "jaw": mouth.jaw * (1 - 0.85 * bite),
        "bite": np.maximum(bite, closing),
        "width": mouth.width,
        "fullness": mouth.fullness * (1 + 0.08 * roundness),
        "roundness": roundness * (OO_ROUNDNESS + (1 - OO_ROUNDNESS) * mouth.pursed),
        "spread": wide,
        "oval": mouth.oval,
        "protrusion": 0.06 * roundness + 0.02 * mouth.pursed,
        "press": closing,
        "tuck": mouth.tuck * (1 - closing),
        "tongue_out": out,
        "tongue_up": np.minimum(mouth.tongue / TIP_UP, 1) * (1 - out) * (1 - teeth),
        "smile": 0.004 * wide
        + (MOOD_SMILE * mouth.smile - MOOD_FROWN * mouth.frown - MOOD_TIGHT * serious) * (1 - roundness),
        "shut": moved.lids,
        "brows": moved.brows,
    }
    rows = np.stack(list(curves.values()), axis=1).tolist()
    return [
        CharacterPose(**dict(zip(curves, row, strict=True)), mood=mood, gaze=(across, up), turn=(yaw, pitch, roll))
        for row, mood, (across, up), (yaw, pitch, roll) in zip(
            rows, moved.upper_face, moved.gaze.tolist(), moved.turn.tolist(), strict=True
        )
    ]


def _rise(gap: Curve, roundness: Curve, wide: Curve, tuck: Curve, raised: Curve) -> Curve:
    """Return how far the upper lip rises [shape=(F,)]: little in round lips; spread lips and F bare the teeth.

    raised : how far a mood raises it
    """
    rise = upper_share(gap)
    rise = rise + raised * np.maximum(np.minimum(0.8 * gap, RAISED_LIP) - rise, 0)
    rise = rise + wide * np.maximum(np.minimum(SPREAD_RISE * gap, 0.07) - rise, 0)
    rise = rise + roundness * (0.48 * gap - rise)
    return np.minimum(rise + tuck * np.maximum(gap - rise, 0), gap)
