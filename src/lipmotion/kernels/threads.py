"""The library of NumPy's matrix products (BLAS): its number of threads, and the processor that it computes for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute matrix products in one thread inside the block (or the function that this decorates).

    The last bits of a product depend on the number of threads: with one, results do not depend on ``OMP_NUM_THREADS``,
    nor on the division of work among processes. For products as small as ours one thread is no slower. The limit holds
    for the whole process; of several Python threads the first that sets it decides (threadpoolctl). Libraries that
    cannot be limited (Accelerate on macOS) are not changed.
    """
    import numpy as np  # noqa: F401 # only what is loaded can be limited

    with _loaded_libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _loaded_libraries(_: int) -> Any:
    """Return threadpoolctl's controller of the libraries in use; asked for again when modules have been imported."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def blas_kernels() -> list[str]:
    """Return the name, version and processor of each BLAS in use, in alphabetical order.

    Two machines, or two settings of ``OPENBLAS_CORETYPE``, round differently where these differ.
    """
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401 # has a copy of its own
    from threadpoolctl import threadpool_info

    loaded = [each for each in threadpool_info() if each["user_api"] == "blas" and "opencv" not in each["filepath"]]
    return sorted(f"{each['internal_api']} {each['version']} {each.get('architecture')}" for each in loaded)
