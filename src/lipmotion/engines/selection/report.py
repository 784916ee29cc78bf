"""Texts about an inventory: what it lacks, and where a unit comes from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.inventory import Inventory, standing_in
from lipmotion.units import PHONES


def unit_names(inventory: Inventory, units: NDArray[np.intp]) -> tuple[str, ...]:
    """Return for each of some units its recording, and its phone and time there: ``bbaf2n 0.530-0.610 s b``."""
    windows = inventory.windows
    return tuple(
        f"{inventory.names[windows.recording[unit]]} {start_s:.3f}-{end_s:.3f} s {PHONES[windows.phones[unit]]}"
        for unit, (start_s, end_s) in zip(units, windows.times_s[units].tolist(), strict=True)
    )


def coverage_text(inventory: Inventory) -> str:
    """Return which phones an inventory has, which it lacks, and what stands in for these."""
    windows, usable = inventory.windows, inventory.usable
    counts = {phone: int((usable & (windows.phones == n)).sum()) for n, phone in enumerate(PHONES)}
    stand_ins = standing_in(windows, usable)
    lines = [f"{int(usable.sum())} units of {len(inventory.names)} recordings"]
    lines.append("units of each phone: " + ", ".join(f"{p} {c}" for p, c in sorted(counts.items()) if c))
    if stand_ins:
        missing = ", ".join(f"{phone} ({other})" for phone, other in sorted(stand_ins.items()))
        lines.append(f"phones without units (and what stands in for them): {missing}")
    return "\n".join(lines)
