"""The mouth shapes of 2D animation, and the shapes that suit each phone.

Nine drawings: six that every character has, A to F (they go back to Hanna-Barbera), and three that are optional.
Letters, meanings, fallbacks and the other names are those of Rhubarb Lip Sync's documentation, so that characters
and tools made for it work; the table of phones is our own.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MouthShape:
    """One drawing of the mouth.

    meaning  : what is drawn
    opening  : between the lips, 0 closed, 1 as wide as in speech
    spread   : of the corners of the mouth, 1 a smile, -1 puckered
    blair    : its name among Preston Blair's shapes
    fallback : the basic shape that is shown where this one is not drawn; empty: it is a basic shape itself
    """

    meaning: str
    opening: float
    spread: float
    blair: str
    fallback: str = ""


SHAPES: dict[str, MouthShape] = {
    "A": MouthShape("closed, lips pressed: p b m", 0.0, 0.0, "MBP"),
    "B": MouthShape("slightly open, teeth together: most consonants, ee", 0.35, 0.4, "etc"),
    "C": MouthShape("open: e as in men, a as in bat", 0.6, 0.2, "E"),
    "D": MouthShape("wide open: a as in father", 0.85, 0.0, "AI"),
    "E": MouthShape("slightly rounded: o as in off, ir as in bird", 0.5, -0.5, "O"),
    "F": MouthShape("puckered: oo as in you, w", 0.2, -1.0, "U"),
    "G": MouthShape("upper teeth on the lower lip: f v", 0.15, 0.0, "FV", fallback="A"),
    "H": MouthShape("open, tongue raised behind the upper teeth: l", 0.6, 0.0, "L", fallback="C"),
    "X": MouthShape("at rest, lips closed and relaxed: silence", 0.0, 0.0, "rest", fallback="A"),
}
OPTIONAL = "".join(name for name, shape in SHAPES.items() if shape.fallback)
REST = "X"


@dataclass(frozen=True)
class PhoneShapes:
    """The shapes that suit one part of a phone.

    share   : of the phone's duration
    best    : shapes that suit it best
    allowed : shapes that are acceptable
    """

    share: float
    best: str
    allowed: str = ""


_PHONE_SHAPES: tuple[tuple[str, tuple[PhoneShapes, ...]], ...] = (
    ("sil sp", (PhoneShapes(1, "X", "A"),)),
    ("p b m", (PhoneShapes(1, "A"),)),
    ("em", (PhoneShapes(0.4, "BC", "E"), PhoneShapes(0.6, "A"))),
    ("f v", (PhoneShapes(1, "G"),)),
    ("l el", (PhoneShapes(1, "H", "BCE"),)),
    ("w", (PhoneShapes(1, "F", "E"),)),
    ("uw uh", (PhoneShapes(1, "F", "E"),)),
    ("ow", (PhoneShapes(0.6, "E", "CF"), PhoneShapes(0.4, "F", "E"))),
    ("ao", (PhoneShapes(1, "E", "CD"),)),
    ("oy", (PhoneShapes(0.6, "E", "C"), PhoneShapes(0.4, "B", "C"))),
    ("er axr", (PhoneShapes(1, "E", "BC"),)),
    ("aa", (PhoneShapes(1, "D"),)),
    ("ay", (PhoneShapes(0.6, "D", "C"), PhoneShapes(0.4, "B", "C"))),
    ("aw", (PhoneShapes(0.6, "D", "C"), PhoneShapes(0.4, "E", "F"))),
    ("ae eh ah", (PhoneShapes(1, "C", "D"),)),
    ("ey", (PhoneShapes(0.6, "C", "BD"), PhoneShapes(0.4, "B", "C"))),
    ("iy ih ix ax y", (PhoneShapes(1, "B", "C"),)),
    ("r", (PhoneShapes(1, "BE", "F"),)),
    ("sh zh ch jh", (PhoneShapes(1, "BF", "E"),)),
    ("s z t d th dh", (PhoneShapes(1, "B", "CEF"),)),
    ("n en k g ng", (PhoneShapes(1, "B", "CEF"),)),
)
PHONE_SHAPES: dict[str, tuple[PhoneShapes, ...]] = {
    phone: looks for phones, looks in _PHONE_SHAPES for phone in phones.split()
}
ANY_OPEN: tuple[PhoneShapes, ...] = (PhoneShapes(1, "BCDEF"),)
"""For hh and phones of another inventory: the motion alone decides, the lips stay open."""
ANY_SHAPE: tuple[PhoneShapes, ...] = (PhoneShapes(1, "ABCDEF"),)
"""For speech without known phones: the motion alone decides, also whether the lips are open."""


def shapes_of_phone(phone: str) -> tuple[PhoneShapes, ...]:
    """Return the shapes that suit each part of a phone; an empty text stands for an unknown phone."""
    return PHONE_SHAPES.get(phone, ANY_OPEN) if phone else ANY_SHAPE


def drawn_shape(shape: str, drawn: str) -> str:
    """Return the shape itself if it is drawn, else its fallback."""
    return shape if shape in drawn else SHAPES[shape].fallback
