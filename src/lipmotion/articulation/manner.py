"""Manners of speaking: how far the mouth moves in whispered, shouted and mumbled speech.

Sources: P. Edwards, C. Landreth, E. Fiume and K. Singh, "JALI: an animator-centric viseme model for expressive lip
synchronization", ACM Transactions on Graphics 35(4), 2016, whose two dials are low for mumbled and high for shouted
speech; R. Schulman, "Articulatory dynamics of loud and normal speech", Journal of the Acoustical Society of America 85,
1989: jaw and lips move further in loud speech. Deviations: one factor for jaw and lips; a manner is asked for, and not
detected; the factors are ours, set by eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from lipmotion.articulation.curve_edits import with_gain
from lipmotion.types import Gain, Generation
from lipmotion.types.moods import PLAIN, MoodKey

FACTORS: Final = {PLAIN: 1.0, "whisper": 0.85, "shout": 1.5, "mumble": 0.5}
"""How large the movements of the mouth are in each manner, beside those of plain speech."""


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
