"""The 13 visemes of Xie & Liu 2007, Table 1, and the chart of mouth shapes of 2D animation with their names.

The chart has nine drawings: six that every character has, A to F (they go back to Hanna-Barbera), and three that are
optional. Letters, meanings, fallbacks and the other names are those of Rhubarb Lip Sync's documentation, so that
characters and tools made for it work.
"""

from __future__ import annotations

from dataclasses import dataclass

VISEMES: dict[str, tuple[str, ...]] = {
    "sip": ("sil", "sp"),  # silence (the print's /sip/ is /sil/; sp joins it)
    "lr1": ("ao", "aa", "ah", "er", "oy", "aw", "hh"),  # vowels by lip rounding, 1 to 4
    "lr2": ("uw", "uh", "ow", "em"),
    "lr3": ("ae", "eh", "ey", "ay"),
    "lr4": ("ih", "iy", "ax", "axr", "ix"),
    "as": ("l", "el", "r", "y"),  # alveolar semi-vowels
    "af": ("s", "z"),  # alveolar fricatives
    "al": ("t", "d", "n", "en"),  # alveolar
    "pa": ("sh", "zh", "ch", "jh"),  # palato-alveolar
    "bi": ("p", "b", "m"),  # bilabial: the mouth closes
    "de": ("th", "dh"),  # dental
    "ld": ("f", "v"),  # labio-dental
    "ve": ("ng", "k", "g", "w"),  # velar
}

VISEME_OF: dict[str, str] = {phone: viseme for viseme, phones in VISEMES.items() for phone in phones}

VOWELS = frozenset(phone for viseme in ("lr1", "lr2", "lr3", "lr4") for phone in VISEMES[viseme]) - {"hh", "em"}
"""The phones of the visemes of vowels that are vowels."""


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
LETTERS = {name.lower(): name for name in SHAPES}
BLAIR = {shape.blair.lower(): name for name, shape in SHAPES.items()} | {"wq": "F"}
"""Shapes by Preston Blair's names; his E is another shape than the letter."""


def choose_drawn_shape(shape: str, drawn: str) -> str:
    """Return the shape itself if it is drawn, else its fallback."""
    return shape if shape in drawn else SHAPES[shape].fallback
