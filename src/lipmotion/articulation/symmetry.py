"""Motion with the left and the right of the mouth alike."""

from __future__ import annotations

from lipmotion.articulation.lip_points import mouth_template
from lipmotion.types import Motion

BLOCK_FRAMES = 10_000
"""Frames that are computed at a time, so that hours of motion take little memory beside their copy."""


def make_symmetrical(motion: Motion, asymmetry: float = 0.0) -> Motion:
    """Return motion whose lip and jaw points move alike on both sides; distances and weights stay as they are.

    asymmetry : 0 to 1: the share that is left of the difference between the sides of the speaker's own mouth
    Points are in the head frame: x to the speaker's left, 0 between the eyes.
    """
    template, names = mouth_template(), {*motion.names}
    if asymmetry >= 1 or not names.issuperset(f"{axis}_{point}" for point in template.points for axis in "xyz"):
        return motion
    values = motion.values.copy()
    for axis, sign in (("x", -1.0), ("y", 1.0), ("z", 1.0)):
        columns = [motion.column(f"{axis}_{point}") for point in template.points]
        for start in range(0, len(values), BLOCK_FRAMES):
            own = values[start : start + BLOCK_FRAMES, columns]
            both = (own + sign * own[:, template.mirrored]) / 2
            values[start : start + BLOCK_FRAMES, columns] = both + asymmetry * (own - both)
    return Motion(values, motion.rate_hz, motion.channels)
