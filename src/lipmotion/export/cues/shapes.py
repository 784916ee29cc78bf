"""The mouth shapes of 2D animation, and which of them each phone may look like.

Nine drawings: six that every character has, A to F (they go back to Hanna-Barbera), and three that are optional.
Letters, meanings, fallbacks and the other names are those of Rhubarb Lip Sync's documentation, so that characters
and tools made for it work; the table of phones is our own.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shape:
    """One drawing of the mouth.

    meaning  : what is drawn
    opening  : between the lips on an average day, 0 shut, 1 as far as they go
    spread   : of the mouth's corners, 1 a smile, -1 puckered
    blair    : its name among Preston Blair's shapes
    fallback : the basic shape that takes its place where it is not drawn; empty: it is a basic shape
    """

    meaning: str
    opening: float
    spread: float
    blair: str
    fallback: str = ""


SHAPES: dict[str, Shape] = {
    "A": Shape("closed, lips pressed: p b m", 0.0, 0.0, "MBP"),
    "B": Shape("slightly open, teeth together: most consonants, ee", 0.35, 0.4, "etc"),
    "C": Shape("open: e as in men, a as in bat", 0.6, 0.2, "E"),
    "D": Shape("wide open: a as in father", 0.85, 0.0, "AI"),
    "E": Shape("slightly rounded: o as in off, ir as in bird", 0.5, -0.5, "O"),
    "F": Shape("puckered: oo as in you, w", 0.2, -1.0, "U"),
    "G": Shape("upper teeth on the lower lip: f v", 0.15, 0.0, "FV", fallback="A"),
    "H": Shape("open, tongue raised behind the upper teeth: l", 0.6, 0.0, "L", fallback="C"),
    "X": Shape("at rest, lips closed and relaxed: silence", 0.0, 0.0, "rest", fallback="A"),
}
OPTIONAL = "".join(name for name, shape in SHAPES.items() if shape.fallback)
REST = "X"


@dataclass(frozen=True)
class Look:
    """What one part of a phone looks like.

    share   : of the phone's duration
    best    : shapes that show it as it should be
    allowed : shapes that pass
    """

    share: float
    best: str
    allowed: str = ""


_LOOKS: tuple[tuple[str, tuple[Look, ...]], ...] = (
    ("sil sp", (Look(1, "X", "A"),)),
    ("p b m", (Look(1, "A"),)),
    ("em", (Look(0.4, "BC", "E"), Look(0.6, "A"))),
    ("f v", (Look(1, "G"),)),
    ("l el", (Look(1, "H", "BCE"),)),
    ("w", (Look(1, "F", "E"),)),
    ("uw uh", (Look(1, "F", "E"),)),
    ("ow", (Look(0.6, "E", "CF"), Look(0.4, "F", "E"))),
    ("ao", (Look(1, "E", "CD"),)),
    ("oy", (Look(0.6, "E", "C"), Look(0.4, "B", "C"))),
    ("er axr", (Look(1, "E", "BC"),)),
    ("aa", (Look(1, "D", "C"),)),
    ("ay", (Look(0.6, "D", "C"), Look(0.4, "B", "C"))),
    ("aw", (Look(0.6, "D", "C"), Look(0.4, "E", "F"))),
    ("ae eh ah", (Look(1, "C", "D"),)),
    ("ey", (Look(0.6, "C", "BD"), Look(0.4, "B", "C"))),
    ("iy ih ix ax y", (Look(1, "B", "C"),)),
    ("r", (Look(1, "BE", "F"),)),
    ("sh zh ch jh", (Look(1, "BF", "E"),)),
    ("s z t d th dh", (Look(1, "B", "CEF"),)),
    ("n en k g ng", (Look(1, "B", "CEF"),)),
)
LOOKS: dict[str, tuple[Look, ...]] = {phone: looks for phones, looks in _LOOKS for phone in phones.split()}
ANY_OPEN: tuple[Look, ...] = (Look(1, "BCDEF"),)
"""hh, and phones of another inventory: the motion alone decides."""
ANY: tuple[Look, ...] = (Look(1, "ABCDEF"),)
"""Speech of which no phone is known: the motion alone decides whether the lips are open, too."""


def looks_of(phone: str) -> tuple[Look, ...]:
    """Return what a phone (empty: an unknown one) looks like, part by part."""
    return LOOKS.get(phone, ANY_OPEN) if phone else ANY


def fallback(shape: str, drawn: str) -> str:
    """Return the shape itself if it is drawn, else the one that takes its place."""
    return shape if shape in drawn else SHAPES[shape].fallback
