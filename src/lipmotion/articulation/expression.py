"""Expression: moods of a motion over time, and the facial action units that show them.

A mood is a set of facial action units with intensities, 0 to 1 (``moods.csv``); motion carries moods as channels, so
that files hold them. Phones limit what the action units do to the mouth (``articulation.mouth``); elsewhere they add to
blinks and accents (``articulation.liveliness``).

Sources (the column ``source``): EMFACS, P. Ekman and W. V. Friesen, "EMFACS-7: Emotional Facial Action Coding System",
1983, and P. Ekman, W. V. Friesen and J. C. Hager, "Facial Action Coding System: Investigator's Guide", 2002, of the
prototypes of emotions; Ekman2003, P. Ekman, "Emotions Revealed", 2003; Harrigan1996, J. A. Harrigan and D. M.
O'Connell, "How do you look when feeling anxious? Facial displays of anxiety", Personality and Individual Differences
21, 1996; Sundelin2013, T. Sundelin et al., "Cues of fatigue: effects of sleep deprivation on facial appearance", Sleep
36, 2013. Deviations: the intensities are ours, set by eye on our faces; so are the action units of the source ``ours``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import WEIGHT, Channel, Motion
from lipmotion.types.delivery import MOODS, MoodKey

Curve = NDArray[np.float64]

PREFIX: Final = "mood_"  # the channels of moods are called so, and the mood: ``mood_happy``, a weight
CHANGE_S: Final = (0.25, 0.2)  # a mood begins to change so long before its time, and has changed so long after it


@cache
def read_mood_table() -> Mapping[str, Mapping[int, float]]:
    """Return the intensity of the action units of each mood, 0 to 1: the table ``moods.csv``."""
    table: dict[str, dict[int, float]] = {mood: {} for mood in MOODS}
    for row in read_shipped_table("lipmotion.articulation", "moods.csv"):
        table[row["mood"]][int(row["action_unit"])] = float(row["intensity"])
    return table


def is_mood(channel: str) -> bool:
    """Return whether a channel of motion holds a mood."""
    return channel.startswith(PREFIX) and channel[len(PREFIX) :] in MOODS


def with_moods(motion: Motion, keys: Sequence[MoodKey]) -> Motion:
    """Return motion with the channels of moods over time after its own, instead of those that it had.

    keys : in the order of their times; before the first one the face is neutral, unless it is at 0. Without any mood
           the motion is as it is; manners do not count
    The sum of all moods is at most 1 in every frame; each change is a smooth step around its time (``CHANGE_S``).
    """
    keys = [key for key in keys if not key.is_manner]
    if not keys:
        return motion
    time_s, others = motion.time_s, motion.selected([name for name in motion.names if not is_mood(name)])
    curves = {key.mood: np.zeros(len(time_s)) for key in keys if key.mood in MOODS}
    for key in keys:
        begin_s = key.time_s - CHANGE_S[0]
        share = smooth_step((time_s - begin_s) / sum(CHANGE_S)) if key.time_s > 0 else np.ones(len(time_s))
        wanted = dict.fromkeys(curves, 0.0) | {key.mood: key.strength}
        curves = {mood: curve + share * (wanted[mood] - curve) for mood, curve in curves.items()}
    added = [curve[:, None].astype(motion.values.dtype) for curve in curves.values()]
    values = np.concatenate([others.values, *added], axis=1)
    return Motion(values, motion.rate_hz, (*others.channels, *(Channel(PREFIX + mood, WEIGHT) for mood in curves)))


def list_action_units(motion: Motion, time_s: Curve | None = None) -> dict[int, Curve]:
    """Return the action units of moods, 0 to 1 [each shape=(N,)], at some times (None: all frames); none if neutral."""
    units: dict[int, Curve] = {}
    for mood, curve in read_moods(motion).items():
        if curve.any():
            strength = curve if time_s is None else np.interp(time_s, motion.time_s, curve)
            for unit, intensity in read_mood_table()[mood].items():
                units[unit] = units.get(unit, 0.0) + intensity * strength
    return {unit: np.clip(curve, 0, 1) for unit, curve in units.items()}


def read_moods(motion: Motion) -> dict[str, Curve]:
    """Return how strong each mood of a motion is, 0 to 1, by its name [each shape=(T,)]."""
    names = filter(is_mood, motion.names)
    return {name[len(PREFIX) :]: np.clip(motion[name].astype(np.float64), 0, 1) for name in names}
