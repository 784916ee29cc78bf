"""Motion as it is delivered: one place from which files, curves, cues and videos get it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from lipmotion.articulation.curve_edits import GAIN_EDGE_S, weigh_span
from lipmotion.articulation.delivery import Delivery, hold_poses, intensify, shift_in_time
from lipmotion.articulation.expression import is_mood, with_moods
from lipmotion.meshes.fitting.blendshape_motion import is_of_blendshapes, with_mouth
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, to_arkit
from lipmotion.types import Generation, VoiceEvent
from lipmotion.types.audio import LAUGHTER
from lipmotion.types.delivery import NEUTRAL, PLAIN, MoodKey, sort_moods
from lipmotion.types.motion import RADIAN

FACTORS: Final = {PLAIN: 1.0, "whisper": 0.65, "shout": 1.5, "mumble": 0.5}
"""How large the movements of the mouth are in each manner, beside those of plain speech."""

LAUGHING: Final = "happy"
"""The mood of a face that laughs: cheeks and corners of the lips are raised; ``articulation.rest`` opens the jaw."""


def with_detected(requested: Sequence[MoodKey], events: Sequence[VoiceEvent]) -> tuple[MoodKey, ...]:
    """Return moods and manners over time: those that are asked for, and where no mood is, that of laughter."""
    keys = list(requested)
    for event in events if all(key.is_manner for key in requested) else ():
        if event.kind == LAUGHTER:
            keys += [MoodKey(event.start_s, LAUGHING), MoodKey(event.end_s, NEUTRAL)]
    return sort_moods(keys)


def with_manners(generation: Generation, keys: Sequence[MoodKey], *, in_place: bool = False) -> Generation:
    """Return generated motion whose mouth moves more, or less, in some manners of speaking; what is closed stays so.

    keys : in the order of their times; moods do not count. Each holds until the next manner
    in_place : as of ``intensify``
    """
    manners, time_s = [key for key in keys if key.is_manner], generation.motion.time_s
    last, intensity = MoodKey(len(time_s) / generation.motion.rate_hz, PLAIN), np.ones(len(time_s))
    for key, later in pairwise((*manners, last)):
        if key.time_s < later.time_s:
            near = slice(*np.searchsorted(time_s, (key.time_s - GAIN_EDGE_S, later.time_s + GAIN_EDGE_S)))
            share = weigh_span(time_s[near], key.time_s, later.time_s, GAIN_EDGE_S)
            intensity[near] *= 1 + share * key.strength * (FACTORS[key.mood] - 1)
    return intensify(generation, intensity, in_place=in_place)


def deliver(generation: Generation, delivery: Delivery) -> Generation:
    """Return generated motion with its mood, intensity, anticipation and offset; held poses come last (``hold_poses``).

    Moods of the delivery at time 0 are those before the first one of the generation, and later ones are added to these;
    without any, motion keeps the moods that it has. So do manners of speaking. Where no mood is asked for, that of
    laughter counts.
    Raises InputError: the offset leaves nothing.
    """
    keys = with_detected(sort_moods((*delivery.moods, *generation.moods)), generation.events)
    if has_moods := not all(key.is_manner for key in keys):
        generation = generation.selected([name for name in generation.motion.names if not is_mood(name)])
        generation = generation.with_motion(with_moods(generation.motion, keys))
    generation = with_manners(generation, keys, in_place=has_moods)
    if delivery.intensity != 1:
        motion = generation.motion
        opening = with_mouth(motion)["opening"].astype(np.float64) if is_of_blendshapes(motion) else None
        generation = intensify(generation, delivery.intensity, opening, in_place=has_moods)
    return shift_in_time(generation, delivery)


def hold_mouth_poses(generation: Generation, frames: int, closed_s: Sequence[float]) -> Generation:
    """Return a generation whose mouth is held (``hold_poses``); eyes, brows, cheeks and head move as before.

    frames : 0: everything moves as before; 1: every frame is a pose, which formats that can say so hold
    """
    motion = generation.motion
    names = tuple(
        channel.name
        for channel in motion.channels
        if channel.unit != RADIAN and to_arkit(channel.name) not in ARKIT_OTHERS and not is_mood(channel.name)
    )
    if not frames or not names:
        return generation
    mouth = replace(hold_poses(generation.selected(names), frames, closed_s), stepped=names)
    if names == motion.names:  # the variance of an hour of all channels would not fit in memory
        return mouth
    columns = [motion.column(name) for name in names]
    values, variance = motion.values.astype(np.float64), np.array(generation.variance)
    values[:, columns], variance[:, columns] = mouth.motion.values, mouth.variance
    return replace(mouth, motion=replace(motion, values=values), spread=variance)
