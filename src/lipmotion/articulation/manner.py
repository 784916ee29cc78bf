"""Manners of speaking: how far the mouth moves in whispered, shouted and mumbled speech; and moods that are detected.

Sources: P. Edwards, C. Landreth, E. Fiume and K. Singh, "JALI: an animator-centric viseme model for expressive lip
synchronization", ACM Transactions on Graphics 35(4), 2016, whose two dials are low for mumbled and high for shouted
speech; R. Schulman, "Articulatory dynamics of loud and normal speech", Journal of the Acoustical Society of America 85,
1989: jaw and lips move further in loud speech. Deviations: one factor for jaw and lips; the factors are ours, set by
eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from lipmotion.articulation.curve_edits import with_gain
from lipmotion.types import Gain, Generation, VoiceEvent
from lipmotion.types.moods import NEUTRAL, PLAIN, MoodKey, in_time
from lipmotion.types.voice_event import LAUGHTER, SHOUT, WHISPER

FACTORS: Final = {PLAIN: 1.0, "whisper": 0.85, "shout": 1.5, "mumble": 0.5}
"""How large the movements of the mouth are in each manner, beside those of plain speech."""

LAUGHING: Final = "happy"
"""The mood of a face that laughs: cheeks and corners of the lips are raised; ``articulation.pauses`` opens the jaw."""


def with_detected(asked: Sequence[MoodKey], events: Sequence[VoiceEvent]) -> tuple[MoodKey, ...]:
    """Return moods and manners over time: those that are asked for, or else those that are detected.

    asked  : where it has a mood, no other is detected; where it has a manner, no manner
    events : laughter is a mood; phrases that are whispered or shouted have this manner, as far as they are strong
    """
    manner_of = {LAUGHTER: False, WHISPER: True, SHOUT: True}
    keys = list(asked)
    for event in events:
        is_manner = manner_of.get(event.kind)
        if is_manner is None or any(key.is_manner == is_manner for key in asked):
            continue
        named, usual = (event.kind, PLAIN) if is_manner else (LAUGHING, NEUTRAL)
        strength = event.strength if is_manner else 1.0
        keys += [MoodKey(event.start_s, named, strength), MoodKey(event.end_s, usual)]
    return in_time(keys)


def with_manners(generation: Generation, keys: Sequence[MoodKey]) -> Generation:
    """Return generated motion whose mouth moves more, or less, in some manners of speaking; what is closed stays so.

    keys : in the order of their times; moods do not count. Each holds until the next manner
    """
    manners = [key for key in keys if key.is_manner]
    last = MoodKey(len(generation.motion.values) / generation.motion.rate_hz, PLAIN)
    for key, stop_s in ((key, later.time_s) for key, later in pairwise((*manners, last))):
        factor = 1 + key.strength * (FACTORS[key.mood] - 1)
        if factor != 1 and key.time_s < stop_s:
            generation = with_gain(generation, Gain(key.time_s, stop_s, factor))
    return generation
