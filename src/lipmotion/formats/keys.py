"""Keys of curves in files with straight lines between keys: which may be left out, and where a curve jumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
JUMP_S = 1e-3
"""How long a change at once may last, in seconds."""


@dataclass(frozen=True)
class Thinning:
    """Which keys may be left out.

    tolerance : of every curve, between the keys that are kept, in the curves' own unit; 0: none is left out
    closed_s  : seconds at which the lips close: the keys there are kept, and those beside them
    """

    tolerance: float = 0.0
    closed_s: tuple[float, ...] = ()

    def choose(self, time_s: Array, rows: Array) -> NDArray[np.intp]:
        """Return the numbers of the keys that stay, rising, the first and the last among them.

        time_s : seconds, rising [shape=(K,)]; rows : of curves [shape=(K, N)]
        Source: Ramer 1972; Douglas & Peucker 1973. Deviations: the distance is that of the values, not of the points;
        all curves have the same keys, so the largest distance of any counts.
        """
        if not self.tolerance or len(rows) < 3:
            return np.arange(len(rows))
        is_kept = np.zeros(len(rows), bool)
        is_kept[[0, -1]] = True
        for each_s in self.closed_s:
            nearest = int(np.abs(time_s - each_s).argmin())
            is_kept[max(nearest - 1, 0) : nearest + 2] = True
        fixed = np.flatnonzero(is_kept).tolist()
        open_ends = list(pairwise(fixed))
        while open_ends:
            first, last = open_ends.pop()
            if last - first < 2:
                continue
            those_s, those = time_s[first : last + 1], rows[first : last + 1]
            share = (those_s - those_s[0]) / (those_s[-1] - those_s[0])
            errors = np.abs(those - those[0] - share[:, None] * (those[-1] - those[0])).max(axis=1, initial=0.0)
            errors[[0, -1]] = 0.0
            if errors.max() > self.tolerance:
                middle = first + int(errors.argmax())
                is_kept[middle] = True
                open_ends += [(first, middle), (middle, last)]
        return np.flatnonzero(is_kept)


EVERY_KEY = Thinning()


def with_jumps(time_s: Array, rows: Array, stepped: Sequence[bool]) -> tuple[Array, Array]:
    """Return evenly spaced keys with those added that let some curves change at once between straight lines.

    time_s  : seconds [shape=(T,)]; rows : of curves [shape=(T, N)]; stepped : which curves change at once [N values]
    An added key is ``JUMP_S`` before a change, or a tenth of the time between two keys, whichever is shorter.
    """
    chosen = np.array(stepped, bool)
    changed = np.flatnonzero(np.diff(rows[:, chosen], axis=0).any(axis=1)) + 1
    if not len(changed):
        return time_s, rows
    step_s = float(time_s[1] - time_s[0])
    early_s = min(JUMP_S, step_s / 10)
    before = rows[changed] - early_s / step_s * (rows[changed] - rows[changed - 1])
    before[:, chosen] = rows[changed - 1][:, chosen]
    return np.insert(time_s, changed, time_s[changed] - early_s), np.insert(rows, changed, before, axis=0)


def place_keys(time_s: Array, rows: Array, stepped: Sequence[bool], thinning: Thinning) -> tuple[Array, Array]:
    """Return times and values of keys, with straight lines between, of even rows; arguments as of ``with_jumps``."""
    all_s, all_rows = with_jumps(time_s, rows, stepped)
    chosen = thinning.choose(all_s, all_rows)
    return all_s[chosen], all_rows[chosen]
