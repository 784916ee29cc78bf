"""How motion is delivered: its options, moods and manners over time, and how a face is shown beside what it says."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from lipmotion.errors import InputError, shorten
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion.types.values import suggest

NEUTRAL = "neutral"
MOODS = ("happy", "sad", "angry", "afraid", "disgusted", "surprised", "tense", "tired")
"""The moods that a face shows beside none, ``NEUTRAL``."""
PLAIN = "plain"
MANNERS = ("whisper", "shout", "mumble")  # the manners of speaking beside the usual one, ``PLAIN``
_NAMES = (NEUTRAL, *MOODS, PLAIN, *MANNERS)
_NUMBER = r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?)"
_KEY = re.compile(rf"([a-z]+)(?::{_NUMBER})?(?:\s+at\s+{_NUMBER})?", re.IGNORECASE)


@dataclass(frozen=True)
class MoodKey:
    """A mood that a face goes over to at a time, or a manner of speaking, and keeps until the next one of its kind.

    time_s   : seconds in the recording
    mood     : one of ``MOODS``, or ``NEUTRAL``; or one of ``MANNERS``, or ``PLAIN``
    strength : 0 to 1
    Raises InputError: no such mood, or a value out of its range.
    """

    time_s: float
    mood: str
    strength: float = 1.0

    def __post_init__(self) -> None:
        if self.mood not in _NAMES:
            near, known = suggest(self.mood, _NAMES), ", ".join(_NAMES)
            raise InputError(f"the mood is {shorten(repr(self.mood))}{near}, required one of: {known}")
        if not 0 <= self.strength <= 1:
            raise InputError(f"the strength of the mood {self.mood} is {self.strength:g}, required 0 to 1")
        if not 0 <= self.time_s < float("inf"):
            raise InputError(f"the mood {self.mood} begins at {self.time_s:g} s, required 0 or more")

    @property
    def is_manner(self) -> bool:
        """Whether it is a manner of speaking."""
        return self.mood in (PLAIN, *MANNERS)

    @property
    def label(self) -> str:
        """The mood with its strength, as ``happy:0.7``."""
        return self.mood if self.strength == 1 else f"{self.mood}:{self.strength:g}"

    def __str__(self) -> str:
        return f"{self.label} at {self.time_s:.12g}"


@dataclass(frozen=True)
class MoodTag:
    """A mood that a tag in a text asks for.

    share    : of the words of the text that stand before it, 0 to 1
    mood, strength : as of ``MoodKey``
    """

    share: float
    mood: str
    strength: float = 1.0


def parse_moods(text: str) -> tuple[MoodKey, ...]:
    """Return the moods that a text states, in the order of their times; none for an empty text.

    text : ``MOOD``, ``MOOD:STRENGTH``, or several with their times in seconds: ``happy:0.7, sad at 2.5``
    Raises InputError: another form, or as ``MoodKey``.
    """
    keys = []
    for part in filter(None, map(str.strip, text.split(","))):
        key = _KEY.fullmatch(part)
        if key is None:
            raise InputError(
                f"the mood is {shorten(repr(part))}, required MOOD, MOOD:STRENGTH or MOOD:STRENGTH at SECONDS, "
                "as happy:0.7 at 2.5; several with commas"
            )
        keys.append(MoodKey(float(key[3] or 0.0), key[1].lower(), float(key[2] or 1.0)))
    return sort_moods(keys)


def format_moods(keys: Iterable[MoodKey]) -> str:
    """Return moods as the text that ``parse_moods`` reads."""
    return ", ".join(map(str, keys))


def sort_moods(keys: Sequence[MoodKey]) -> tuple[MoodKey, ...]:
    """Return moods and manners in the order of their times; of several of a kind at one time the last."""
    latest = {(key.time_s, key.is_manner): key for key in keys}
    return tuple(latest[place] for place in sorted(latest))


USUAL_HOLD_MS = 2000 / 24
"""Held poses last as long as two frames of an animation at 24 frames a second, if nothing else is asked for."""


def _milliseconds(least: float, most: float, what: str, shown: str) -> Any:
    """Return an option in milliseconds, usually 0; ``what``: it is called, and ``shown`` of it to users."""
    return option(0.0, Rule(least, most=most, unit=" ms"), what=what, metavar="N", help=shown)


@dataclass(frozen=True)
class Delivery(Configuration):
    """How motion is delivered to files and videos, beside what it says.

    intensity       : 1: as spoken; up to 3: movements away from the rest pose so many times as large. What is closed
                      stays closed, and silence stays at rest
    anticipation_ms : the mouth moves so many milliseconds before the sound, -1000 to 1000
    offset_ms       : the sound begins so many milliseconds after time 0 of the timeline; negative: before it, and what
                      would be before time 0 is left out. For files that are put beside a sound; videos have their own
    min_hold_ms     : 0: the curves are smooth; more: poses are held, each for at least so many milliseconds
    mood            : what the face expresses, and the manner of speaking, over time (``types.delivery.parse_moods``):
                      ``happy``, ``sad:0.6, whisper``, ``happy:0.7, neutral at 2.5``; empty: what the words or the
                      motion say, else nothing
    stepped         : poses are held; with ``min_hold_ms`` 0, each for at least two frames at 24 frames a second
    key_tolerance   : keys of files that have keys are left out where a straight line between others gives the weights
                      to within so much; 0: every frame is a key
    Raises InputError: a value out of its range, or no such mood.

    >>> Delivery(anticipation_ms=40).hold_ms, Delivery(stepped=True).hold_ms > 80, Delivery(min_hold_ms=120).hold_ms
    (0.0, True, 120)
    """

    intensity: float = option(1.0, Rule(0, most=3), metavar="X", help="movements of the mouth X times as large, 0 to 3")
    anticipation_ms: float = _milliseconds(-1000, 1000, "anticipation", "the mouth moves N ms before the sound")
    offset_ms: float = _milliseconds(
        -600_000, 600_000, "offset", "everything in motion, label and cue files comes N ms later; negative: earlier"
    )
    min_hold_ms: float = _milliseconds(0, 10_000, "least hold", "hold every pose for at least N ms")
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


SCENE, TRANSPARENT = "scene", "transparent"
SMALLEST_PX, LARGEST_PX = 64, 4096  # range of the height of pictures, in pixels
_MOVING: dict[str, Any] = {
    "still": "--still",
    "metavar": "NAME,NAME",
    "help": "what does not move on its own, with commas: blinks,gaze,brows,head",
}


@dataclass(frozen=True)
class Staging(Configuration):
    """How a face is shown, beside what it says.

    size       : height of the picture in pixels, an even number; 0: the face's own
    background : ``scene`` (the face's own), ``transparent``, or a colour as ``#40a0ff``
    blinks, gaze, brows, head : whether these move on their own
    seed       : of the movements that depend on chance
    Raises InputError: a value out of its range, or no such background.

    >>> Staging(size=480, head=False, background="#40a0ff").colour
    (64, 160, 255)
    """

    size: int = option(0, Rule(least=0), metavar="PIXELS", help="height of the face's picture")
    background: str = SCENE
    blinks: bool = option(True, **_MOVING)
    gaze: bool = option(True, **_MOVING)
    brows: bool = option(True, **_MOVING)
    head: bool = option(True, **_MOVING)
    seed: int = option(0, Rule(least=0), flags=("--face-seed",), metavar="N", help="other blinks, glances and nods")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.size and not (SMALLEST_PX <= self.size <= LARGEST_PX and self.size % 2 == 0):
            raise InputError(f"the size is {self.size} pixels, required an even number, {SMALLEST_PX} to {LARGEST_PX}")
        if self.background not in (SCENE, TRANSPARENT) and not re.fullmatch("#[0-9a-fA-F]{6}", self.background):
            raise InputError(
                f"the background is {shorten(self.background)!r}, required scene, transparent, or a colour as #40a0ff"
                f"{'; a video is for filmed faces; give one: --face FILE.face' * ('.' in self.background)}"
            )

    @property
    def colour(self) -> tuple[int, int, int] | None:
        """Red, green and blue of the background, 0..255; None: it has no single colour."""
        if not self.background.startswith("#"):
            return None
        return int(self.background[1:3], 16), int(self.background[3:5], 16), int(self.background[5:7], 16)
