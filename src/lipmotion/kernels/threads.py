"""The library behind NumPy's matrix products: how many threads it uses, and for which processor it computes."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_LOCK = threading.Lock()
_inside = 0
_limits: Any = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute matrix products in one thread inside the block (or the function that this decorates).

    The last bits of a product depend on how many threads share it: with one, results are the same whatever
    ``OMP_NUM_THREADS`` says, and however work is divided among processes. For products as small as ours one thread is
    no slower. The limit holds for the whole process until the last of several blocks, in whatever threads of Python,
    is left. Libraries that cannot be limited (Accelerate on macOS) are left as they are.
    """
    _enter()
    try:
        yield
    finally:
        _leave()


def blas_kernels() -> list[str]:
    """Return the name, version and processor of each BLAS in use, in alphabetical order.

    Two machines, or two settings of ``OPENBLAS_CORETYPE``, round differently where these differ.
    """
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401 # has a copy of its own
    from threadpoolctl import threadpool_info

    loaded = [each for each in threadpool_info() if each["user_api"] == "blas" and "opencv" not in each["filepath"]]
    return sorted(f"{each['internal_api']} {each['version']} {each.get('architecture')}" for each in loaded)


def _enter() -> None:
    global _inside, _limits  # noqa: PLW0603 # the limit is one of the whole process
    import numpy as np  # noqa: F401 # only what is loaded can be limited
    from threadpoolctl import threadpool_limits

    with _LOCK:
        if not _inside:
            _limits = threadpool_limits(1, user_api="blas")
        _inside += 1


def _leave() -> None:
    global _inside, _limits  # noqa: PLW0603
    with _LOCK:
        _inside -= 1
        if not _inside:
            _limits.restore_original_limits()
            _limits = None
