"""Fast formatting of many numbers as text."""

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


def formatted_rows(values: NDArray[np.floating[Any]]) -> Iterator[str]:
    """Yield each row of values [shape=(T, P)] as text: numbers with commas between them, rounded to ``DECIMALS``.

    Raises ExportError: a value is not finite.
    Cost: one formatting call per row, a fifth of a microsecond per number; half the time of ``json.dumps``.
    """
    form = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
    for start in range(0, len(values), BLOCK):
        with np.errstate(over="ignore"):
            positive_zeros = np.round(values[start : start + BLOCK].astype(float), DECIMALS) + 0.0
        if not np.isfinite(positive_zeros).all():
            raise ExportError("the motion has values that are not finite, or too large to be rounded")
        yield from (form % tuple(row) for row in positive_zeros.tolist())
