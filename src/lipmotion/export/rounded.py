"""Many numbers as text, fast."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

DECIMALS = 5
"""A hundred-thousandth of the distance between the eyes is about a micrometre."""


def rows(values: NDArray[np.float64]) -> list[str]:
    """Return each row of values [shape=(T, P)] as text, numbers parted by commas, rounded to ``DECIMALS``.

    Cost: one formatting call a row, a fifth of a microsecond a number; half of what ``json.dumps`` takes.
    """
    form = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
    positive_zeros = np.round(values, DECIMALS) + 0.0
    return [form % tuple(row) for row in positive_zeros.tolist()]
