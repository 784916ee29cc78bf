"""The decorators that compile kernels by numba when they are first called; without numba they run as they are, slowly.

Loading numba takes as long as a short recording's motion, so importing this or any kernel does not load it. Three
kernels also have a form in NumPy, which gives the same bits, and say why in their first line (``pays`` chooses).
Compiled functions take many arrays as separate arguments: numba compiles that to the fastest code.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar, cast

import numpy as np

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
LONG_FRAMES = 30_000
"""So many frames take NumPy half as long as loading numba takes: 13 µs each (docs/results/kernels.md)."""
KEPT_BYTES = 31 << 20
"""After so many bytes were allocated and freed at once, glibc keeps freed memory for the next array. Otherwise it gives
every larger array back to the system and asks for it again: that takes as long as some kernels."""
_LOCK = RLock()


def compiled(function: FunctionT) -> FunctionT:
    """Compile a function at its first call; the result is cached on disk if possible."""
    return cast(FunctionT, _Kernel(function, False))


def compiled_to_rounding(function: FunctionT) -> FunctionT:
    """Compile a function as ``compiled`` does, but with sums in any order: results differ from NumPy's by rounding."""
    return cast(FunctionT, _Kernel(function, {"nnan", "nsz", "reassoc", "contract", "arcp"}))


@cache
def numba_works() -> bool:
    """Return whether numba can be imported; this imports it."""
    try:
        import numba  # noqa: F401
    except ImportError:  # not installed, or not made for this NumPy
        return False
    np.empty(KEPT_BYTES, np.uint8)  # freed at once
    return True


def pays(frames: int = 0) -> bool:
    """Return whether the compiled form of a kernel pays for so many frames: many, or numba is loaded already."""
    return (frames > LONG_FRAMES or "numba" in sys.modules) and numba_works()


class _Kernel:
    """A function that is compiled when it is first called, with all kernels that it calls."""

    def __init__(self, function: Callable[..., Any], fastmath: set[str] | bool) -> None:
        self.function, self.fastmath = function, fastmath
        self.kernel: Any = None
        self._is_ready = False
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        if not self._is_ready:
            with _LOCK:
                self.prepare()
        return self.kernel(*arguments)

    def prepare(self) -> Any:
        """Make the kernel and return it. Kernels call one another by global names, under which numba must find it."""
        if self.kernel is None:
            self.kernel = _machine_code(self.function, self.fastmath) if numba_works() else _interpreted(self.function)
            names = self.function.__globals__
            for name, value in list(names.items()):
                if isinstance(value, _Kernel):
                    names[name] = value.prepare()
            self._is_ready = True
        return self.kernel


def _machine_code(function: Callable[..., Any], fastmath: set[str] | bool) -> Any:
    import numba

    kernel = numba.njit(nogil=True, error_model="numpy", fastmath=fastmath)(function)
    with suppress(RuntimeError):  # neither beside the file nor in the user's cache folder can anything be written
        kernel._cache = _disk_cache()(function)  # as its ``enable_caching``
    return kernel


def _interpreted(function: Callable[..., Any]) -> Callable[..., Any]:
    _warn_once()
    return np.errstate(all="ignore")(function)


@cache
def _warn_once() -> None:
    logging.getLogger("lipmotion").warning("numba is not installed: this is computed by Python alone, slowly")


@cache
def _disk_cache() -> Any:
    """Return the class of numba's caches on disk; what is damaged is compiled again, what cannot be stored is not."""
    from numba.core.caching import FunctionCache

    class Cache(FunctionCache):  # type: ignore[misc] # of a package without types
        def load_overload(self, sig: Any, target_context: Any) -> Any:
            try:
                return super().load_overload(sig, target_context)
            except Exception:  # unpickling what is damaged may raise anything
                with suppress(OSError):
                    self.flush()
                return None

        def save_overload(self, sig: Any, data: Any) -> None:
            with suppress(OSError):
                super().save_overload(sig, data)

    return Cache


def cache_folder() -> Path | None:
    """Return the folder where machine code is kept between processes; None: nowhere can be written."""
    try:
        return Path(_disk_cache()(cache_folder).cache_path)
    except RuntimeError:
        return None
