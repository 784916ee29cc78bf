"""Which frames of a curve are keys in files that have straight lines between keys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def key_frames(time_s: Array, values: Array, tolerance: float, *, stepped: bool) -> list[int]:
    """Return the frames that are keys: where held values change, or else those of ``kept_keys``."""
    return changes(values) if stepped else kept_keys(time_s, values, tolerance)


def kept_keys(time_s: Array, values: Array, tolerance: float) -> list[int]:
    """Return frames between which straight lines stay within a tolerance of all values, the first and last among them.

    Source: Douglas and Peucker 1973, with vertical distances.  Cost: O(T log T) for most curves.
    """
    kept, spans = {0, len(values) - 1}, [(0, len(values) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        share = (time_s[inner] - time_s[first]) / (time_s[last] - time_s[first])
        off = np.abs(values[inner] - values[first] - share * (values[last] - values[first]))
        worst = int(off.argmax())
        if off[worst] > tolerance:
            middle = first + 1 + worst
            kept.add(middle)
            spans += [(first, middle), (middle, last)]
    return sorted(kept)


def changes(values: Array) -> list[int]:
    """Return the frames in which values differ from the frame before, with the first and the last frame."""
    return sorted({0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values) - 1})
