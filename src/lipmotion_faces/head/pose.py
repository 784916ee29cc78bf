"""Poses of the head, and how they follow from the spoken mouth and what moves beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lipmotion.articulation.liveliness import CALM, Liveliness, UpperFace
from lipmotion.articulation.mouth import SpokenMouth, find_mouth, weigh_upper
from lipmotion.articulation.phone_targets import TIP_UP
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import Staging, stage_liveliness

SPREAD_RISE = 0.52
"""Part of the gap by which the upper lip rises where lips are spread: the upper teeth show more than the lower ones."""
BITTEN_GAP = (0.12, 0.2)  # teeth stay together up to the first gap, and part until the second one
BITTEN = (0.72, 0.94)  # teeth are apart up to the first value of ``teeth``, and together from the second on
OO_ROUNDNESS = 0.8  # how round the lips of oo are; those of w are a ring
MOOD_SMILE, MOOD_FROWN, MOOD_TIGHT, RAISED_LIP = 0.065, 0.07, 0.025, 0.06
"""How far a mood raises the corners, lowers them, lowers those of serious lips, and raises the upper lip."""
FULL_NARROWING, FULL_WIDENING = 0.16, 0.12
"""Changes of width at which lips are round, and spread, whatever the phones ask for."""


class CharacterPose(NamedTuple):
    """Numbers that move the head. Lengths are in eye distances; most others go from 0 to 1.

    gap        : distance of the inner lips; 0: they touch
    upper_rise : how far the upper lip rises from the line of the closed lips; the rest of the gap is the lower lip's
    jaw        : drop of the chin
    width      : distance of the lip corners, relative to the rest pose
    fullness   : thickness of the lips, relative to the rest pose
    roundness  : 1 is a round hole, as in OO
    spread     : 1 is a wide flat slot, as in EE
    oval       : 1 is a tall oval hole, as in AA
    protrusion : how far the lips are pushed forward, a length
    press      : 1: lips pressed together, as in P B M
    tuck       : 1: lower lip against the upper teeth, as in F V
    bite       : 1: teeth together, as in S
    tongue_out : 1: tip of the tongue between the teeth, as in TH
    tongue_up  : 1: tip of the tongue behind the upper teeth, as in L N T D
    smile      : how far the corners rise, a length
    shut       : 1: eyes closed
    brows      : how far the brows rise, a length
    mood       : what a mood does to brows, lids, cheeks and nose
    gaze       : of the eyes to the character's left and upwards, in radians
    turn       : of the head: yaw to the character's left, pitch upwards, roll to the left shoulder, in radians
    """

    gap: float = 0.0
    upper_rise: float = 0.0
    jaw: float = 0.0
    width: float = 1.0
    fullness: float = 1.0
    roundness: float = 0.0
    spread: float = 0.0
    oval: float = 0.0
    protrusion: float = 0.0
    press: float = 0.0
    tuck: float = 0.0
    bite: float = 0.0
    tongue_out: float = 0.0
    tongue_up: float = 0.0
    smile: float = 0.0
    shut: float = 0.0
    brows: float = 0.0
    mood: UpperFace = CALM
    gaze: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def list_head_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging | None = None, prosody: Prosody | None = None
) -> list[CharacterPose]:
    """Return the pose at ``n / fps`` seconds, to the end of the motion. Raises InputError: as ``find_mouth``."""
    mouth = find_mouth(motion, units, fps)
    return pose_head(mouth, stage_liveliness(np.arange(len(mouth.gap)) / fps, motion, units, staging, prosody))


def pose_head(mouth: SpokenMouth, moved: Liveliness) -> list[CharacterPose]:
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
    corners = MOOD_SMILE * mouth.smile - MOOD_FROWN * mouth.frown - MOOD_TIGHT * serious
    rise = weigh_upper(gap)  # the upper lip rises little in round lips; spread lips and F bare the teeth
    rise = rise + mouth.upper_raise * np.maximum(np.minimum(0.8 * gap, RAISED_LIP) - rise, 0)
    rise = rise + np.maximum(wide, 0.9 * teeth) * np.maximum(np.minimum(SPREAD_RISE * gap, 0.07) - rise, 0)
    rise = rise + roundness * (0.48 * gap - rise)
    curves = {
        "gap": gap,
        "upper_rise": np.minimum(rise + mouth.tuck * np.maximum(gap - rise, 0), gap),
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
        "smile": 0.004 * wide + 0.03 * mouth.tuck * (1 - closing) + corners * (1 - roundness),
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


def stack_poses(poses: Sequence[CharacterPose]) -> CharacterPose:
    """Return poses as one whose numbers are columns [shape=(T, 1)]: for what is computed for many at once."""

    def stack(rows: Sequence[Any]) -> list[Any]:  # a member of several numbers is left out: empty
        numbers = ([] if isinstance(column[0], tuple) else column for column in zip(*rows, strict=True))
        return [np.array(column, float)[:, None] for column in numbers]

    return CharacterPose._make(stack(poses))._replace(mood=UpperFace._make(stack([pose.mood for pose in poses])))
