"""The pose of the head in one frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from lipmotion.articulation.liveliness import CALM, UpperFace


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


def stacked(poses: Sequence[CharacterPose]) -> CharacterPose:
    """Return poses as one whose numbers are columns [shape=(T, 1)]: for what is computed for many at once."""
    return CharacterPose._make(_columns(poses))._replace(mood=UpperFace._make(_columns([pose.mood for pose in poses])))


def _columns(rows: Sequence[Any]) -> Iterator[Any]:
    """Yield each member of some rows as a column [shape=(T, 1)]; a member of several numbers is left out: empty."""
    for column in zip(*rows, strict=True):
        yield np.array(column if isinstance(column[0], float | int) else [], float)[:, None]
