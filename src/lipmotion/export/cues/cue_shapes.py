"""The mouth shapes of 2D animation that suit each phone (``units.mouth_chart``). The table is our own."""

from __future__ import annotations

from dataclasses import dataclass


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
