"""A user's own rig: a table that says which controls follow which curves, with gain and offset.

The table beside a character is the same: its controls are the blendshapes, one row each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.storage.text_table import from_field, read_whole_table
from lipmotion.types import Channel, Motion
from lipmotion.types.values import parse_number, suggest

COLUMNS = ("control", "source", "gain", "offset", "low", "high")
CONTROL = "control"  # the unit of controls of a user's rig
LARGEST_TABLE_BYTES, MAX_CONTROLS = 1 << 20, 2000
LARGEST_NUMBER = 1e6


@dataclass(frozen=True)
class RigRow:
    """A control that follows ``offset + gain · source``; rows of one control add up, with the limits of the first."""

    control: str
    source: str
    gain: float = 1.0
    offset: float = 0.0
    low: float = -np.inf
    high: float = np.inf

    def alone(self, curve: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the control where no other row moves it.  curve : of the source"""
        return np.clip(self.offset + self.gain * curve, self.low, self.high)


def read_rig_table(path: Path) -> tuple[RigRow, ...]:
    """Return the rows of a CSV of ``COLUMNS``; empty fields have their usual value. Raises InputError: damaged."""
    names, lines = read_whole_table(path, "rig table", LARGEST_TABLE_BYTES, COLUMNS)
    if names[:2] != list(COLUMNS[:2]) or not set(names) <= set(COLUMNS):
        raise InputError(f"{path}: the columns are {shorten(','.join(names))!r}, required {','.join(COLUMNS)}")
    rows = []
    for line, fields in lines:
        texts = dict.fromkeys(COLUMNS, "") | dict(zip(names, map(from_field, map(str.strip, fields)), strict=False))
        if texts["control"].startswith("#"):
            continue
        try:
            if not texts["control"]:
                raise ValueError("a row without a control")
            numbers = {name: _number(texts[name]) for name in COLUMNS[2:] if texts[name]}
            row = RigRow(texts["control"], texts["source"], **numbers)
            if row.low > row.high:
                raise ValueError(f"{row.control!r} goes from {row.low:g} to {row.high:g}")
            rows.append(row)
        except ValueError as error:
            raise InputError(f"{path}: line {line}: {shorten(str(error))}") from error
    if not rows or len(rows) > MAX_CONTROLS:
        raise InputError(f"{path}: {len(rows)} rows, required 1 to {MAX_CONTROLS}")
    return tuple(rows)


def suggest_names(name: str, names: Iterable[str]) -> str:
    """Return what a message says where there is no such name: the nearest ones, or else the first ones."""
    known = list(dict.fromkeys(names))
    return suggest(name, known, "nearest: {}", 3) or f"there are {shorten(', '.join(known)) or 'none'}"


def apply_rig(rows: Sequence[RigRow], sources: Mapping[str, NDArray[np.float64]], rate_hz: float) -> Motion:
    """Return a rig's controls over time, of curves by name [each shape=(T,)]. Raises InputError: one is missing."""
    curves: dict[str, NDArray[np.float64]] = {}
    limits: dict[str, tuple[float, float]] = {}
    for row in rows:
        if row.source and row.source not in sources:
            what = f"the control {shorten(row.control)!r} follows {shorten(row.source)!r}, which is no curve;"
            raise InputError(f"{what} {suggest_names(row.source, sources)}")
        value = row.gain * sources[row.source] if row.source else np.zeros(len(next(iter(sources.values()))))
        curves[row.control] = curves.get(row.control, 0.0) + value + row.offset
        limits.setdefault(row.control, (row.low, row.high))
    columns = [np.clip(curve, *limits[name]) for name, curve in curves.items()]
    return Motion(np.stack(columns, axis=1), rate_hz, tuple(Channel(name, CONTROL) for name in curves))


def _number(text: str) -> float:
    value = parse_number(text.replace(",", "."))
    if not abs(value) <= LARGEST_NUMBER:
        raise ValueError(f"the number {text}, required at most {LARGEST_NUMBER:g}")
    return value


def find_table(character: Path) -> Path:
    """Return where the table of a character is: ``head.glb`` has ``head.glb.character.csv`` in the same folder."""
    named = character.resolve() if character.name in {"", ".."} else character
    return named.parent / f"{named.name}.character.csv"
