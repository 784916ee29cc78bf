"""The five unit sets of Hofer 2008 (§6, Table 1), with a reason for each group of phones.

The paper gives the number of units of each set and a line of text on them; the groups are ours. Counts, and silence:

- ``2vis``: 2; silence belongs to the closed mouth;
- ``sVis``: 6 groups of speech as printed, and silence is a unit beside them;
- ``pbVis``: 9 drawings of a speaking mouth; Preston Blair's mouth at rest is a unit beside them;
- ``eVis``: 19; silence is one of the 10 that are not vowels;
- ``phone``: 46, silence among them; ``sp``, a pause between words, is the 47th phone of our inventory.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from lipmotion.errors import InputError
from lipmotion.units.phones import PAUSE, PHONES
from lipmotion.units.unit_set import CLOSED_UNIT, UnitSet, read_unit_table
from lipmotion.units.visemes import VISEME_OF


class UnitGroup(NamedTuple):
    """The phones of one unit, and why they are together."""

    unit: str
    phones: str
    reason: str


_OPEN_PHONES = (
    "aa ae ah ao aw ax axr ay ch d dh eh el en er ey f g hh ih ix iy jh k l n ng ow oy r s sh t th uh uw v w y z zh"
)
_BILABIAL = UnitGroup("bilabial", "p b m em", "the lips meet")
_LABIODENTAL = UnitGroup("labiodental", "f v", "the lower lip is at the upper teeth")
_SILENCE = UnitGroup("silence", "sil sp", "no speech; the mouth rests or prepares for speech")

GROUPS: dict[str, tuple[UnitGroup, ...]] = {
    "2vis": (
        UnitGroup(
            "open", _OPEN_PHONES, "the lips are apart, in f v, too: the lip is at the teeth, not at the other lip"
        ),
        UnitGroup(CLOSED_UNIT, "p b m em sil sp", "the lips meet; in silence they rest on each other"),
    ),
    "sVis": (
        UnitGroup("front", "iy ih ix eh ey ax axr er", "not low, not back: jaw half shut, lips spread or slack"),
        UnitGroup(
            "low", "aa ae ah aw ay", "low: the jaw drops; diphthongs stand where they begin, for that part is longer"
        ),
        UnitGroup("back", "ao ow oy uh uw", "back, not low: the vowels that round the lips"),
        _BILABIAL,
        _LABIODENTAL,
        UnitGroup(
            "other",
            "ch d dh el en g hh jh k l n ng r s sh t th w y z zh",
            "all other consonants: lips hardly needed; w rounds them, but does not shut them",
        ),
        _SILENCE,
    ),
    "pbVis": (
        UnitGroup("AI", "aa ae ah aw ay", "wide open: a as in father, i as in ice"),
        UnitGroup(
            "E", "eh ey iy ih ix ax er axr", "open and spread: e as in let and in see, and the slack vowels near them"
        ),
        UnitGroup("O", "ao ow oy", "round and open"),
        UnitGroup("U", "uh uw", "round and nearly shut"),
        UnitGroup("WQ", "w", "puckered tightly; q is written k w here"),
        UnitGroup("MBP", "p b m em", "the lips meet"),
        UnitGroup("FV", "f v", "the lower lip is at the upper teeth"),
        UnitGroup("L", "l el", "the tongue shows behind the upper teeth"),
        UnitGroup(
            "etc",
            "ch d dh en g hh jh k n ng r s sh t th y z zh",
            "teeth together: his C D G K N R S TH Y Z and those made like them",
        ),
        UnitGroup("rest", "sil sp", "lips together and relaxed"),
    ),
    "eVis": (
        UnitGroup("aw", "aw", "diphthong: open, then rounding"),
        UnitGroup("ay", "ay", "diphthong: open, then spreading"),
        UnitGroup("ey", "ey", "diphthong: half open, then spreading"),
        UnitGroup("ow", "ow", "diphthong: rounded, then narrower"),
        UnitGroup("oy", "oy", "diphthong: rounded, then spreading"),
        UnitGroup("high", "iy ih ix", "high front vowels: jaw nearly shut, lips spread"),
        UnitGroup("mid", "eh ax axr er", "mid vowels, front and central: jaw half shut, lips slack"),
        UnitGroup("low", "aa ae ah", "low vowels: the jaw drops"),
        UnitGroup("back", "ao uh uw", "back vowels: lips rounded"),
        _BILABIAL,
        _LABIODENTAL,
        UnitGroup("dental", "th dh", "the tongue's tip at or between the teeth: the jaw stays a little open for it"),
        UnitGroup("alveolar", "t d n en", "the tongue at the gum, lips free to do what the neighbours want"),
        UnitGroup("sibilant", "s z", "teeth together"),
        UnitGroup("palatal", "sh zh ch jh", "teeth together, lips pushed forward"),
        UnitGroup("hidden", "k g ng hh", "made at the back: nothing of it shows, the neighbours decide"),
        UnitGroup("glide", "l el y", "the tongue raised, lips not rounded"),
        UnitGroup("rounded", "w r", "lips rounded or pushed forward"),
        _SILENCE,
    ),
    "phone": tuple(UnitGroup(phone, phone, "itself") for phone in PHONES),
}
_UNCOUNTED = {"sVis": "silence", "pbVis": "rest", "phone": PAUSE}
"""Units that the paper's count leaves out."""


def _built_in(name: str) -> UnitSet:
    of = {phone: group.unit for group in GROUPS[name] for phone in group.phones.split()}
    return UnitSet(name, of, frozenset([_UNCOUNTED[name]] if name in _UNCOUNTED else []))


UNIT_SETS: dict[str, UnitSet] = {name: _built_in(name) for name in GROUPS}
"""The unit sets in the order of the paper's Table 1, except sVis, which is placed by its size."""
VISEME_SET = UnitSet("viseme", VISEME_OF)
"""The 13 visemes of Xie & Liu 2007, Table 1; not one of the five."""


def load_unit_set(name_or_path: str | Path) -> UnitSet:
    """Return a unit set of the papers by its name, or read one from a table file (docs/unit-sets.md).

    Raises InputError: neither a name nor a file, or a table that is wrong (with its line).
    """
    known = UNIT_SETS | {VISEME_SET.name: VISEME_SET}
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    if not os.path.exists(name_or_path):  # noqa: PTH110 - False, not an error, for a name that no file can have
        raise InputError(
            f"no unit set {str(name_or_path)!r}; there are: {', '.join(known)}; or give a table file, "
            "a unit and its phones a line"
        )
    return read_unit_table(Path(name_or_path))
