"""Classes of phones by their importance for lip-reading, and how units overlap in a phone that they share.

Source: Minnis & Breen 2000, §3 and Table 1.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from lipmotion.errors import InputError
from lipmotion.units import PHONES, is_silent

PROTECTED_PHONES = ("f", "v", "m", "em", "p", "b")
"""Phones whose lip shape every join must preserve. The print names /v/ twice and /b/ never."""
PROTECTED, INVISIBLE, NORMAL = "protected", "invisible", "normal"

Overlaps = Mapping[tuple[str, str], float]
"""The forward share of a shared phone, 0 to 1, by the classes of the phones before and after it."""

TABLE_1: Overlaps = {
    (PROTECTED, PROTECTED): 0.50,
    (PROTECTED, INVISIBLE): 0.77,
    (PROTECTED, NORMAL): 0.55,
    (INVISIBLE, PROTECTED): 0.23,
    (INVISIBLE, INVISIBLE): 0.50,
    (INVISIBLE, NORMAL): 0.27,
    (NORMAL, PROTECTED): 0.45,
    (NORMAL, INVISIBLE): 0.77,
    (NORMAL, NORMAL): 0.50,
}
"""Table 1 as printed. Its rows (forward) are the phone before, its columns (backward) the phone after."""
SYMMETRIC: Overlaps = {**TABLE_1, (NORMAL, INVISIBLE): 0.73}
"""Table 1 with the one entry changed that makes it symmetric: 73/27 opposite to 27/73."""
MIDDLE: Overlaps = dict.fromkeys(TABLE_1, 0.5)
LEARNED: Overlaps = {**MIDDLE, (NORMAL, PROTECTED): 0.1}
"""The shares with the least errors of joined motion on the training list of GRID s1 (docs/results/selection.md)."""
OVERLAPS: Mapping[str, Overlaps] = {"learned": LEARNED, "printed": TABLE_1, "symmetric": SYMMETRIC, "middle": MIDDLE}


def lip_reading_class(phone: str, invisible: Collection[str]) -> str:
    """Return the class of a phone: ``protected``, ``invisible`` or ``normal``."""
    if phone in PROTECTED_PHONES:
        return PROTECTED
    return INVISIBLE if phone in invisible else NORMAL


def parsed_invisible(text: str) -> frozenset[str]:
    """Return the phones of a text such as ``t d g k``. Raises InputError: one that cannot be invisible."""
    phones = frozenset(text.split())
    for phone in sorted(phones):
        if phone not in PHONES or is_silent(phone) or phone in PROTECTED_PHONES:
            allowed = " ".join(p for p in PHONES if not is_silent(p) and p not in PROTECTED_PHONES)
            raise InputError(f"the phone {phone!r} cannot be invisible; required some of: {allowed}")
    return phones
