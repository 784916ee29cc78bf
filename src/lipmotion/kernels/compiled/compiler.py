"""The decorators that compile all kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def compiled(function: FunctionT) -> FunctionT:
    """Compile a function at its first call; the result is cached on disk if possible.

    It runs without the interpreter's lock. Divisions by zero give infinities, as in NumPy.
    """
    return _compiled(function, False)


def compiled_to_rounding(function: FunctionT) -> FunctionT:
    """Compile a function as ``compiled`` does, but with sums in any order: results differ from NumPy's by rounding."""
    return _compiled(function, {"nnan", "nsz", "reassoc", "contract", "arcp"})


def _compiled(function: FunctionT, fastmath: set[str] | bool) -> FunctionT:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": fastmath}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither beside this file nor in the user's cache folder can anything be written
        return numba.njit(**options)(function)
