"""The phone inventory: the 47 phones of Xie & Liu 2007, Table 1; their likeness, classes, visemes.

The chart of mouth shapes has nine drawings: six that every character has, A to F (they go back to Hanna-Barbera), and
three that are optional. Letters, meanings, fallbacks and the other names are those of Rhubarb Lip Sync's documentation.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from lipmotion.errors import shorten
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Timeline, Unit
from lipmotion.units.spelling import parse_table, read_table

VISEMES = {viseme: tuple(phones.split()) for viseme, phones in read_table("visemes").items()}
VISEME_OF = {phone: viseme for viseme, phones in VISEMES.items() for phone in phones}
VOWELS = frozenset(phone for viseme in ("lr1", "lr2", "lr3", "lr4") for phone in VISEMES[viseme]) - {"hh", "em"}
"""The vowels among the phones of the vowel visemes."""


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


SHAPES = {
    row["shape"]: MouthShape(row["meaning"], float(row["opening"]), float(row["spread"]), row["blair"], row["fallback"])
    for row in read_shipped_table("lipmotion.units", "tables/mouth_shapes.csv")
}
OPTIONAL = "".join(name for name, shape in SHAPES.items() if shape.fallback)
REST = "X"
LETTERS = {name.lower(): name for name in SHAPES}
BLAIR = {shape.blair.lower(): name for name, shape in SHAPES.items()} | {"wq": "F"}
"""Shapes by Preston Blair's names; his E is another shape than the letter."""


def choose_drawn_shape(shape: str, drawn: str) -> str:
    """Return the shape itself if it is drawn, else its fallback."""
    return shape if shape in drawn else SHAPES[shape].fallback


SILENCE = "sil"
PAUSE = "sp"  # a pause between words that is too short to be silence
SHORT_PAUSE_S = 0.2  # silence shorter than this is a pause between words

PHONES: tuple[str, ...] = tuple(sorted(VISEME_OF))
UNKNOWN_PHONES = "spn"
"""The unit, without a phone, of a span in which somebody speaks and nobody says what: as aligners label a word that is
in no dictionary. Its word, where it is given, is that of the whole span."""

_CLOSED = parse_table("pcl=p bcl=b tcl=t_ch_dx dcl=d_jh_dx kcl=k gcl=g")
CLOSURES = {closure: tuple(phones.split()) for closure, phones in _CLOSED.items()}
"""Closures of TIMIT to the phones that they open to; alone, a closure is the first of these."""
OTHER_NAMES = {closure: phones[0] for closure, phones in CLOSURES.items()}
OTHER_NAMES |= parse_table("dx=d nx=n eng=ng ux=uw hv=hh ax-h=ax axh=ax tq=t epi=sil pau=sil h#=sil")
"""Phones that TIMIT and Buckeye name otherwise: the tap of *city* is a d, of *winner* an n.
Source: TIMIT, phoncode.doc; the Buckeye corpus manual."""

REDUCED_VOWELS = {"ah": "ax", "er": "axr", "ih": "ix"}  # vowels to their unstressed forms
FULL_FORMS = {reduced: vowel for vowel, reduced in REDUCED_VOWELS.items()} | {"el": "l", "em": "m", "en": "n"}
"""Unstressed vowels and syllabic consonants to the phones that a dictionary writes for them."""

LIP_CLOSING: tuple[str, ...] = (*VISEMES["bi"], "em")  # the phones in which the lips meet

SIMILAR_PHONES = {phone: tuple(others.split()) for phone, others in read_table("similar_phones").items()}
"""A phone that is not in a corpus borrows the model of the first of these that is."""


def count_phone_edits(wanted: Sequence[str], heard: Sequence[str]) -> int:
    """Return the fewest substitutions, insertions and deletions that make one sequence of phones of another.

    Full and reduced forms of a phone count as the same.
    Source: Wagner & Fischer 1974.

    >>> count_phone_edits(["ax", "b", "el"], ["ah", "b", "l"])
    0
    """
    row = list(range(len(heard) + 1))
    for number, phone in enumerate(wanted, 1):
        above, row = row, [number]
        for column, other in enumerate(heard, 1):
            differs = FULL_FORMS.get(phone, phone) != FULL_FORMS.get(other, other)
            row.append(min(above[column] + 1, row[-1] + 1, above[column - 1] + differs))
    return row[-1]


def is_silent(phone: str) -> bool:
    """Return whether a phone is silence or a pause."""
    return phone in (SILENCE, PAUSE)


def mark_closing_phones(units: Timeline[Unit]) -> list[bool]:
    """Return for each phone whether the lips meet in it: the one rule for contact, gestures, breaths and cues."""
    return [span.label.phone in LIP_CLOSING for span in units]


def describe_unknown_phone(phone: str, where: str = "") -> str:
    """Return the error message for a phone, empty or unknown, found ``where`` (with a blank before it)."""
    if not phone:
        return f"a unit without a phone{where}: only the model that recognised it can use it; give phones instead"
    return f"unknown phone {shorten(repr(phone))}{where}; the phones: {' '.join(PHONES)}"


def find_similar_phone(phone: str, known: Collection[str]) -> str:
    """Return the phone if known, else a known one: by ``SIMILAR_PHONES`` in turn, its viseme, or any."""
    queue = [phone]
    for candidate in queue:
        if candidate in known:
            return candidate
        queue += [similar for similar in SIMILAR_PHONES[candidate] if similar not in queue]
    same_viseme = [other for other in VISEMES[VISEME_OF[phone]] if other in known]
    return same_viseme[0] if same_viseme else min(known)


def find_similar_lips(phone: str, known: Collection[str]) -> str:
    """Return the phone itself if it is known, else the known phone whose lips look most alike.

    A phone of the same viseme comes first, of several the most similar one; else it is ``find_similar_phone``.

    >>> find_similar_lips("m", ["n", "p"]), find_similar_lips("m", ["n", "t"])
    ('p', 'n')
    """
    same_viseme = [other for other in VISEMES[VISEME_OF[phone]] if other in known]
    return find_similar_phone(phone, same_viseme or known)


CLASSES = {name: tuple(phones.split()) for name, phones in read_table("phone_classes").items()}
"""Classes by articulation, as in any textbook of phonetics: what the questions of decision trees are made of."""


def list_phone_classes() -> dict[str, frozenset[str]]:
    """Return the phones of all classes, by name: articulatory classes, visemes, and each phone alone; each set once."""
    named = CLASSES | {f"viseme {name}": phones for name, phones in VISEMES.items()}
    distinct: dict[frozenset[str], str] = {}
    for name, phones in [*named.items(), *((phone, (phone,)) for phone in PHONES)]:
        distinct.setdefault(frozenset(phones), name)
    return {name: phones for phones, name in distinct.items()}
