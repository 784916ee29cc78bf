"""Unit sets: maps from every phone of the inventory to the unit that models it, built in or read from table files.

Of the five of Hofer 2008 (§6, Table 1) the paper gives the number of units and a line of text. The groups, with their
reasons, are ours: ``tables``. ``sp``, a pause between words, is the 47th phone of our inventory, beside their 46.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.storage.sources import read_text_file
from lipmotion.types import Unit
from lipmotion.units.phones import PHONES, SILENCE, VISEME_OF, describe_unknown_phone, is_silent, list_phone_classes

LARGEST_TABLE_BYTES = 1 << 18  # the most bytes of a table file; one of 47 phones has a few hundred
CLOSED_UNIT = "closed"  # name of the only unit that may hold silence and speech


@dataclass(frozen=True)
class UnitSet:
    """A map from every phone of the inventory to its unit.

    name          : of the set, for users
    unit_of_phone : phone to unit, for all phones of the inventory
    uncounted     : units that the printed count of a paper leaves out (``count``)

    Raises InputError: a phone is missing or unknown, a unit has no name or one with a blank in it, or silence shares a
    unit other than ``closed`` with speech.
    """

    name: str
    unit_of_phone: Mapping[str, str]
    uncounted: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        unknown = sorted(set(self.unit_of_phone) - set(PHONES))
        missing = [phone for phone in PHONES if phone not in self.unit_of_phone]
        if unknown or missing:
            wrong = [f"unknown {' '.join(unknown)}"] * bool(unknown) + [f"missing {' '.join(missing)}"] * bool(missing)
            raise InputError(f"unit set {self.name}: phones {'; '.join(wrong)}; required: {' '.join(PHONES)}")
        for phone, unit in self.unit_of_phone.items():
            if unit.split() != [unit]:
                raise InputError(f"unit set {self.name}: the unit of {phone} is {shorten(unit)!r}, not a word")
        spoken = {unit for phone, unit in self.unit_of_phone.items() if not is_silent(phone)} - {CLOSED_UNIT}
        for unit in sorted(spoken.intersection(self.silence)):
            raise InputError(
                f"unit set {self.name}: unit {shorten(unit)!r} holds silence and speech; give sil and sp a unit "
                f"without other phones, or call this one {CLOSED_UNIT!r}: silence is then a closed mouth"
            )

    @cached_property
    def units(self) -> tuple[str, ...]:
        """All units, in the order of the table."""
        return tuple(dict.fromkeys(self.unit_of_phone.values()))

    @property
    def count(self) -> int:
        """The number of units without the uncounted ones."""
        return len(self.units) - len(self.uncounted)

    @cached_property
    def silence(self) -> tuple[str, ...]:
        """The units of the silent phones (sil, sp), whether or not they hold others, too."""
        return tuple(dict.fromkeys(unit for phone, unit in self.unit_of_phone.items() if is_silent(phone)))

    def silent(self, unit: str) -> bool:
        """Return whether all phones of a unit are silent."""
        return unit in self.silence and all(map(is_silent, self.phones(unit)))

    def unit(self, phone: str) -> str:
        """Return the unit of a phone. Raises InputError: it is not in the inventory."""
        if phone not in self.unit_of_phone:
            raise InputError(describe_unknown_phone(phone))
        return self.unit_of_phone[phone]

    def unit_of(self, label: Unit) -> str:
        """Return the unit of a label, or of its phone. Raises InputError: an unknown phone or unit."""
        if label.phone:
            return self.unit(label.phone)
        if label.unit not in self.units:
            what = f"unknown unit {label.unit!r} without a phone; give a phone,"
            raise InputError(f"{what} or one of {' '.join(self.units)}")
        return label.unit

    def label(self, unit: str) -> Unit:
        """Return a label for a unit: with its phone if it has only one or is silence, else without a phone."""
        phones = self.phones(unit)
        if self.silent(unit) and SILENCE in phones:
            return Unit(SILENCE, unit)
        return Unit(phones[0] if len(phones) == 1 else "", unit)

    def phones(self, unit: str) -> tuple[str, ...]:
        """Return the phones of a unit."""
        return tuple(phone for phone, other in self.unit_of_phone.items() if other == unit)

    def classes(self) -> dict[str, frozenset[str]]:
        """Return the sets of units that decision trees may ask about, by name, each set once.

        A class of phones becomes the set of the units all of whose phones are in the class; every unit alone is a set,
        too. Sets of no unit or of all units are left out. Where every phone is a unit these are ``list_phone_classes``.
        """
        members = {unit: frozenset(self.phones(unit)) for unit in self.units}
        names: dict[frozenset[str], str] = {}
        for name, phones in list_phone_classes().items():
            inside = frozenset(unit for unit in self.units if members[unit] <= phones)
            if 1 < len(inside) < len(self.units):
                names.setdefault(inside, f"class {name}" if name in self.units else name)
            elif len(inside) == 1:
                names.setdefault(inside, *inside)
        for unit in self.units:
            names.setdefault(frozenset([unit]), unit)
        return {name: units for units, name in names.items() if len(units) < len(self.units)}


def read_unit_table(path: Path) -> UnitSet:
    """Return the unit set of a table file: lines ``UNIT phone phone ...``; ``#`` starts a comment.

    Raises InputError (with the line): no such file, not UTF-8, a unit twice or without phones, a phone that is unknown,
    twice or missing, or silence in one unit with speech that is not called ``closed``.
    """
    unit_line, phone_line, unit_of_phone = dict[str, int](), dict[str, int](), dict[str, str]()
    for number, line in enumerate(read_text_file(path, "unit table", LARGEST_TABLE_BYTES).splitlines(), start=1):
        unit, *phones = line.split("#")[0].split() or [""]
        if not unit:
            continue
        where = f"{path}, line {number}"
        if not phones:
            raise InputError(f"{where}: unit {shorten(unit)!r} without phones; write the unit, then its phones")
        if unit in unit_line:
            first = unit_line[unit]
            raise InputError(f"{where}: unit {shorten(unit)!r} stands in line {first} already; write it in one line")
        unit_line[unit] = number
        for phone in phones:
            if phone not in PHONES:
                raise InputError(f"{where}: unknown phone {shorten(phone)!r}; the phones are: {' '.join(PHONES)}")
            if phone in phone_line:
                raise InputError(f"{where}: phone {phone!r} has a unit in line {phone_line[phone]} already; keep one")
            phone_line[phone], unit_of_phone[phone] = number, unit
    try:
        return UnitSet(path.stem, unit_of_phone)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _read_own(name: str, uncounted: str = "") -> UnitSet:
    """Return a set of the paper, with the unit that its printed count leaves out."""
    table = read_unit_table(Path(__file__).with_name("tables") / f"{name}.txt")
    return replace(table, uncounted=frozenset(uncounted.split()))


UNIT_SETS = {
    "2vis": _read_own("2vis"),
    "sVis": _read_own("sVis", "silence"),
    "pbVis": _read_own("pbVis", "rest"),
    "eVis": _read_own("eVis"),
    "phone": UnitSet("phone", {phone: phone for phone in PHONES}, frozenset(["sp"])),
}
"""The unit sets in the order of the paper's Table 1, except sVis, which is placed by its size."""
VISEME_SET = UnitSet("viseme", VISEME_OF)  # the 13 visemes of Xie & Liu 2007, Table 1; not one of the five


def load_unit_set(name_or_path: str | Path) -> UnitSet:
    """Return a unit set of the papers by its name, or read one from a table file (docs/unit-sets.md).

    Raises InputError: neither a name nor a file, or a table that is wrong (with its line).
    """
    known = UNIT_SETS | {VISEME_SET.name: VISEME_SET}
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    if not os.path.exists(name_or_path):  # noqa: PTH110 - False, not an error, for a name that no file can have
        what = f"no unit set {str(name_or_path)!r}; there are: {', '.join(known)}; or give a table file,"
        raise InputError(f"{what} a unit and its phones a line")
    return read_unit_table(Path(name_or_path))
