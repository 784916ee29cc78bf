"""How motion is delivered: the options of ``articulation.delivery``."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.moods import MoodKey, parse_moods

MOST_INTENSITY = 3.0
MOST_ANTICIPATION_MS = 1000.0
MOST_HOLD_MS = 10_000.0
MOST_OFFSET_MS = 600_000.0
USUAL_HOLD_MS = 2000 / 24
"""Held poses last as long as two frames of an animation at 24 frames a second, if nothing else is asked for."""


@dataclass(frozen=True)
class Delivery(Configuration):
    """How motion is delivered to files and videos, beside what it says.

    intensity       : 1: as spoken; up to 3: movements away from the rest pose so many times as large. What is closed
                      stays closed, and silence stays at rest
    anticipation_ms : the mouth moves so many milliseconds before the sound, -1000 to 1000
    offset_ms       : the sound begins so many milliseconds after time 0 of the timeline; negative: before it, and what
                      would be before time 0 is left out. For files that are put beside a sound; videos have their own
    min_hold_ms     : 0: the curves are smooth; more: poses are held, each for at least so many milliseconds
    mood            : what the face expresses, and the manner of speaking, over time (``types.moods.parse_moods``):
                      ``happy``, ``sad:0.6, whisper``, ``happy:0.7, neutral at 2.5``; empty: what the words or the
                      motion say, else nothing
    stepped         : poses are held; with ``min_hold_ms`` 0, each for at least two frames at 24 frames a second
    key_tolerance   : keys of files that have keys are left out where a straight line between others gives the weights
                      to within so much; 0: every frame is a key
    Raises InputError: a value out of its range, or no such mood.

    >>> Delivery(anticipation_ms=40).hold_ms, Delivery(stepped=True).hold_ms > 80, Delivery(min_hold_ms=120).hold_ms
    (0.0, True, 120)
    """

    intensity: float = option(
        1.0, Rule(0, most=MOST_INTENSITY), metavar="X", help="movements of the mouth X times as large, 0 to 3"
    )
    anticipation_ms: float = option(
        0.0,
        Rule(-MOST_ANTICIPATION_MS, most=MOST_ANTICIPATION_MS, unit=" ms"),
        what="anticipation",
        metavar="N",
        help="the mouth moves N ms before the sound",
    )
    offset_ms: float = option(
        0.0,
        Rule(-MOST_OFFSET_MS, most=MOST_OFFSET_MS, unit=" ms"),
        what="offset",
        metavar="N",
        help="everything in motion, label and cue files comes N ms later; negative: earlier",
    )
    min_hold_ms: float = option(
        0.0,
        Rule(0, most=MOST_HOLD_MS, unit=" ms"),
        what="least hold",
        metavar="N",
        help="hold every pose for at least N ms",
    )
    stepped: bool = option(False, help="hold poses instead of moving smoothly, each for at least 83 ms")
    mood: str = option(
        "",
        omit_default=True,
        metavar="MOOD[:STRENGTH]",
        help="neutral, happy, sad, angry, afraid, disgusted, surprised, tense, tired; plain, whisper, shout, mumble; "
        "strength 0 to 1; over time: 'happy:0.7, sad at 2.5' (docs/expression.md)",
    )
    key_tolerance: float = option(
        0.0,
        Rule(0, most=1),
        what="tolerance of keys",
        omit_default=True,
        metavar="X",
        help="leave out keys of .glb .usda .anim .tres .vmd that others give to within X of a weight, as 0.01",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.moods  # noqa: B018 # checks them

    @property
    def moods(self) -> tuple[MoodKey, ...]:
        """The moods over time. Raises InputError: as ``parse_moods``."""
        return parse_moods(self.mood)

    @property
    def hold_ms(self) -> float:
        """Least duration of a held pose in milliseconds; 0: the curves are smooth."""
        return self.min_hold_ms or (USUAL_HOLD_MS if self.stepped else 0.0)

    def hold_frames(self, rate_hz: float) -> int:
        """Return the least number of frames of a held pose, at least 1; 0: the curves are smooth."""
        return max(math.ceil(self.hold_ms * rate_hz / 1000 - 1e-6), 1) if self.hold_ms else 0
