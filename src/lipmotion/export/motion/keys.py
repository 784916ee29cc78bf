"""Which frames of a curve are keys in files that have straight lines between keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError

DECIMALS = 5
"""A hundred-thousandth of the distance between the eyes is about a micrometre."""
BLOCK = 2000
"""Rows that are formatted at a time: the text of an hour of all channels would not fit in memory."""
LARGEST_VALUE = 1e9
"""Blocks with larger values are formatted number by number: their digits do not fit in 64 bits."""


def formatted_rows(values: NDArray[np.floating[Any]]) -> Iterator[str]:
    """Yield each row of values [shape=(T, P)] as text: numbers with commas between them, rounded to ``DECIMALS``.

    Raises ExportError: a value is not finite.
    Cost: a twentieth of a microsecond per number; a fifth of the time of ``json.dumps``.
    """
    for start in range(0, len(values), BLOCK):
        with np.errstate(over="ignore"):
            rounded = np.round(values[start : start + BLOCK].astype(float), DECIMALS) + 0.0
        if not np.isfinite(rounded).all():
            raise ExportError("the motion has values that are not finite, or too large to be rounded")
        if rounded.shape[1] and np.abs(rounded).max() < LARGEST_VALUE:
            yield from _rows_of_digits(np.rint(rounded * 10**DECIMALS).astype(np.int64))
        else:
            form = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
            yield from (form % tuple(row) for row in rounded.tolist())


def _rows_of_digits(numbers: NDArray[np.int64]) -> list[str]:
    """Return each row of numbers as text, with a point before the last ``DECIMALS`` digits."""
    sizes = np.abs(numbers)
    digits = max(len(str(sizes.max())), DECIMALS + 1)
    if digits < 10:
        sizes = sizes.astype(np.int32)
    text = np.empty((*numbers.shape, digits + 3), np.uint8)  # sign, digits, point, comma
    used = np.ones(text.shape, bool)
    text[..., 0], used[..., 0] = ord("-"), numbers < 0
    text[..., -2 - DECIMALS], text[..., -1] = ord("."), ord(",")
    text[:, -1, -1] = ord("\n")
    for place in range(digits):
        if place > DECIMALS:
            used[..., -3 - place] = sizes > 0
        sizes, digit = np.divmod(sizes, 10)
        text[..., -(2 if place < DECIMALS else 3) - place] = ord("0") + digit
    return text[used].tobytes().decode("ascii").splitlines()


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
