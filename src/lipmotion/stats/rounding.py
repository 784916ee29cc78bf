"""Variation beyond rounding errors, which differ between processors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

ROUNDING_SHARE = 1e-6
"""Values that differ by less than this share of the largest are equal: single precision keeps seven digits. Curves
that are modelled vary by 1e-3 of their magnitude and more."""


def varies(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which columns of finite values [shape=(T, D)] are not constant but for rounding [shape=(D,)]."""
    return np.asarray(np.ptp(values, axis=0) > ROUNDING_SHARE * np.abs(values).max(axis=0))
