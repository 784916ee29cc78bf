"""Classes of phones that the questions of decision trees are made of."""

from __future__ import annotations

from lipmotion.units.phones import PHONES
from lipmotion.units.visemes import VISEMES

CLASSES: dict[str, tuple[str, ...]] = {
    name: tuple(phones.split())
    for name, phones in {
        # How a sound is made.
        "silence": "sil sp",
        "vowel": "aa ae ah ao aw ax axr ay eh er ey ih ix iy ow oy uh uw",
        "diphthong": "aw ay ey ow oy",
        "stop": "p b t d k g",
        "voiced stop": "b d g",
        "nasal": "m n ng em en",
        "fricative": "f v th dh s z sh zh hh",
        "affricate": "ch jh",
        "approximant": "l el r w y",
        # Where it is made, as far as lips and jaw show it.
        "lips": "p b m em f v w",
        "alveolar": "t d n en s z l el",
        "front vowel": "iy ih ix eh ey ae ay y",
        "back vowel": "aa ao ow uw uh oy aw",
        "high vowel": "iy ih ix uw uh y w",
        "low vowel": "aa ae ah aw ay ao",
        "rounded": "w uw uh ow ao oy aw",
    }.items()
}
"""Classes by articulation, as in any textbook of phonetics; ``list_phone_classes`` adds visemes and single phones."""


def list_phone_classes() -> dict[str, frozenset[str]]:
    """Return the phones of all classes, by name: articulatory classes, visemes, and each phone alone; each set once."""
    named = CLASSES | {f"viseme {name}": phones for name, phones in VISEMES.items()}
    distinct: dict[frozenset[str], str] = {}
    for name, phones in [*named.items(), *((phone, (phone,)) for phone in PHONES)]:
        distinct.setdefault(frozenset(phones), name)
    return {name: phones for phones, name in distinct.items()}
