"""The decorators that compile kernels by numba when they are first called; without numba they run as they are, slowly.

Loading numba takes as long as a short recording's motion, so importing this or any kernel does not load it. Three
kernels also have a form in NumPy, which gives the same bits, and say why in their first line (``pays`` chooses).
Compiled functions take many arrays as separate arguments: numba compiles that to the fastest code.
Matrix products (BLAS) run on one thread (``limit_threads``).
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, lru_cache, update_wrapper
from pathlib import Path
from threading import Lock, RLock
from typing import Any, TypeVar, cast

import numpy as np


@contextmanager
def limit_threads() -> Iterator[None]:
    """Compute matrix products in one thread inside the block (or the function that this decorates).

    The last bits of a product depend on the number of threads: with one, results do not depend on ``OMP_NUM_THREADS``,
    nor on the division of work among processes. For products as small as ours one thread is no slower. The limit holds
    for the whole process, until the last of several Python threads has left such a block. Libraries that cannot be
    limited (Accelerate on macOS) are not changed.
    """
    with _LIMIT:
        yield


class _SharedLimit:
    """The limit of one thread, from when the first Python thread needs it until the last one leaves."""

    def __init__(self) -> None:
        self._lock, self._users, self._limits = Lock(), 0, ExitStack()

    def __enter__(self) -> None:
        with self._lock:
            self._limits.enter_context(_list_libraries(len(sys.modules)).limit(limits=1, user_api="blas"))
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if not self._users:
                self._limits.close()


_LIMIT = _SharedLimit()


@lru_cache(maxsize=1)
def _list_libraries(_: int) -> Any:
    """Return threadpoolctl's controller of the libraries in use; asked for again when modules have been imported."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def list_blas_kernels() -> list[str]:
    """Return the name, version and processor of each BLAS in use, sorted; where these differ, rounding does."""
    import scipy.linalg  # noqa: F401 # has a copy of its own
    from threadpoolctl import threadpool_info

    loaded = [each for each in threadpool_info() if each["user_api"] == "blas" and "opencv" not in each["filepath"]]
    return sorted(f"{each['internal_api']} {each['version']} {each.get('architecture')}" for each in loaded)


FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
LONG_FRAMES = 30_000
"""So many frames take NumPy half as long as loading numba takes: 13 µs each (docs/results/kernels.md)."""
KEPT_BYTES = 31 << 20
"""After so many bytes were allocated and freed at once, glibc keeps freed memory for the next array. Otherwise it gives
every larger array back to the system and asks for it again: that takes as long as some kernels."""
_LOCK = RLock()


def compiled(function: FunctionT, form: FunctionT | None = None) -> FunctionT:
    """Compile a function at its first call; the result is cached on disk if possible.

    form : computes the same bits with NumPy, where there is no numba; None: then the function runs as Python, slowly
    """
    return cast(FunctionT, _Kernel(function, False, form))


def compile_to_rounding(function: FunctionT) -> FunctionT:
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

    def __init__(self, function: Callable[..., Any], fastmath: set[str] | bool, form: Any = None) -> None:
        self.function, self.fastmath, self.form = function, fastmath, form
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
            if numba_works():
                import numba

                self.kernel = numba.njit(nogil=True, error_model="numpy", fastmath=self.fastmath)(self.function)
                with suppress(RuntimeError):  # neither beside the file nor in the user's cache folder can be written
                    self.kernel._cache = _open_disk_cache()(self.function)  # as its ``enable_caching``
            elif self.form is not None:
                self.kernel = self.form
            else:
                _warn_once()
                self.kernel = np.errstate(all="ignore")(self.function)
            names = self.function.__globals__
            for name, value in list(names.items()):
                if isinstance(value, _Kernel):
                    names[name] = value.prepare()
            self._is_ready = True
        return self.kernel


@cache
def _warn_once() -> None:
    logging.getLogger("lipmotion").warning("numba is not installed: this is computed by Python alone, slowly")


@cache
def _open_disk_cache() -> Any:
    """Return the class of numba's caches on disk; damaged code is compiled again, failure to store is ignored."""
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
        return Path(_open_disk_cache()(cache_folder).cache_path)
    except RuntimeError:
        return None
