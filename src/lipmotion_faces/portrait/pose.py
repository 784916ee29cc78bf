"""The pose of a drawn mouth in one frame. Lengths are in eye distances."""

from __future__ import annotations

from typing import NamedTuple

from lipmotion.articulation.mouth import SpokenMouth


class MouthPose(NamedTuple):
    """The mouth in one frame, as ``articulation.mouth.SpokenMouth`` has it.

    gap      : distance of the inner lips, in eye distances; 0: they touch
    width    : distance of the lip corners relative to the rest pose
    fullness : thickness of the lips relative to the rest pose
    jaw      : drop of the chin, in eye distances
    tongue, tuck, protrusion, spread, press, teeth : the articulatory channels, 0..1 (docs/articulation.md)
    oval     : how far the opening is an oval: corners halfway down, round above and below, 0..1
    smile, frown, stretched, upper_raise, chin_raise, tight : of a mood, 0..1
    """

    gap: float
    width: float = 1.0
    fullness: float = 1.0
    jaw: float = 0.0
    tongue: float = 0.0
    tuck: float = 0.0
    protrusion: float = 0.0
    spread: float = 0.0
    press: float = 0.0
    teeth: float = 0.5
    oval: float = 0.0
    smile: float = 0.0
    frown: float = 0.0
    stretched: float = 0.0
    upper_raise: float = 0.0
    chin_raise: float = 0.0
    tight: float = 0.0


def mouth_poses(mouth: SpokenMouth) -> list[MouthPose]:
    """Return the pose of every frame of a mouth."""
    return [MouthPose(**{name: row[name] for name in MouthPose._fields}) for row in mouth.rows()]
