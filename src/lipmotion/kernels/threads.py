"""The library of NumPy's matrix products (BLAS): its number of threads, and the processor that it computes for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from threading import Lock
from typing import Any


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute matrix products in one thread inside the block (or the function that this decorates).

    The last bits of a product depend on the number of threads: with one, results do not depend on ``OMP_NUM_THREADS``,
    nor on the division of work among processes. For products as small as ours one thread is no slower. The limit holds
    for the whole process, until the last of several Python threads has left such a block. Libraries that cannot be
    limited (Accelerate on macOS) are not changed.
    """
    import numpy as np  # noqa: F401 # only what is loaded can be limited

    with _LIMIT:
        yield


class _SharedLimit:
    """The limit of one thread, from when the first Python thread needs it until the last one leaves."""

    def __init__(self) -> None:
        self._lock, self._users, self._limits = Lock(), 0, ExitStack()

    def __enter__(self) -> None:
        with self._lock:
            self._limits.enter_context(_loaded_libraries(len(sys.modules)).limit(limits=1, user_api="blas"))
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if not self._users:
                self._limits.close()


_LIMIT = _SharedLimit()


@lru_cache(maxsize=1)
def _loaded_libraries(_: int) -> Any:
    """Return threadpoolctl's controller of the libraries in use; asked for again when modules have been imported."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def blas_kernels() -> list[str]:
    """Return the name, version and processor of each BLAS in use, sorted; where these differ, rounding does."""
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401 # has a copy of its own
    from threadpoolctl import threadpool_info

    loaded = [each for each in threadpool_info() if each["user_api"] == "blas" and "opencv" not in each["filepath"]]
    return sorted(f"{each['internal_api']} {each['version']} {each.get('architecture')}" for each in loaded)
