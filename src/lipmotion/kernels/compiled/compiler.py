"""The decorators that compile all kernels; without numba these run as they are, slowly."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from lipmotion.kernels.choice import numba_works

if numba_works():
    import numba
    from numba.core.caching import FunctionCache
else:
    FunctionCache = object
    logging.getLogger("lipmotion").warning("numba is not installed: this is computed by Python alone, slowly")

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
    if not numba_works():
        return function
    kernel = numba.njit(nogil=True, error_model="numpy", fastmath=fastmath)(function)
    with suppress(RuntimeError):  # neither beside this file nor in the user's cache folder can anything be written
        kernel._cache = _Cache(function)  # as its ``enable_caching``
    return kernel


class _Cache(FunctionCache):  # type: ignore[misc] # of a package without types
    """Numba's cache on disk; what is damaged in it is compiled again, and what cannot be stored stays in memory."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the stored machine code for a signature; None: there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling what is damaged may raise anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the machine code for a signature, if that is possible."""
        with suppress(OSError):
            super().save_overload(sig, data)


def cache_folder() -> Path | None:
    """Return the folder where machine code is kept between processes; None: nowhere can be written."""
    try:
        return Path(_Cache(cache_folder).cache_path)
    except RuntimeError:
        return None
