"""Texts about an inventory: which phones it has, and where units come from."""

from __future__ import annotations

import re
from collections.abc import Iterable
from textwrap import wrap

import numpy as np

from lipmotion.engines.selection.inventory import RecordedUnits, standing_in
from lipmotion.units import PHONES

LINE = 110
"""Width of a line of text, in characters."""


def source_of(inventory: RecordedUnits, unit: int) -> str:
    """Return the recording of a unit, and its time and phone there: ``bbaf2n 0.530-0.610 s b``."""
    windows = inventory.windows
    start_s, end_s = windows.times_s[unit].tolist()
    return f"{inventory.names[windows.recording[unit]]} {start_s:.3f}-{end_s:.3f} s {PHONES[windows.phones[unit]]}"


def is_source(text: str) -> bool:
    """Return whether a text has the form of ``source_of``: a recording, two times, and a phone."""
    return re.search(r" \d+\.\d+-\d+\.\d+ s \S+$", text) is not None


def units_by_source(inventory: RecordedUnits, sources: Iterable[str]) -> dict[str, int]:
    """Return the units that some texts of ``source_of`` name; other texts are left out."""
    wanted = set(sources)
    recordings = {source.split(" ")[0] for source in wanted}
    numbers = [number for number, name in enumerate(inventory.names) if name.split(" ")[0] in recordings]
    units = np.flatnonzero(np.isin(inventory.windows.recording, numbers) & inventory.usable).tolist()
    named = {source_of(inventory, unit): unit for unit in units}
    return {source: named[source] for source in wanted if source in named}


def inventory_text(inventory: RecordedUnits) -> str:
    """Return how many units each phone has, and what stands in for phones without units."""
    windows, usable = inventory.windows, inventory.usable
    counts = {phone: int((usable & (windows.phones == n)).sum()) for n, phone in enumerate(PHONES)}
    stand_ins = standing_in(windows, usable)
    lines = [f"{int(usable.sum())} units of {len(inventory.names)} recordings"]
    lines += _wrapped("units of each phone", [f"{phone} {count}" for phone, count in counts.items() if count])
    if stand_ins:
        lines += _wrapped(
            "phones without units, and what stands in for them", [f"{p} ({q})" for p, q in stand_ins.items()]
        )
    return "\n".join(lines)


def _wrapped(name: str, items: list[str]) -> list[str]:
    return [f"{name}:", *(f"  {line}" for line in wrap(", ".join(items), LINE))]
