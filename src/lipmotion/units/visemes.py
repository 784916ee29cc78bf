"""The 13 visemes of Xie & Liu 2007, Table 1, and the phones each one covers."""

from __future__ import annotations

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
