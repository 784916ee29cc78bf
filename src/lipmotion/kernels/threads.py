"""The library behind NumPy's matrix products: how many threads it uses, and for which processor it computes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute matrix products in one thread inside the block (or the function that this decorates).

    The last bits of a product depend on how many threads share it, so work that is divided among processes, or stopped
    and continued, is done with one thread in each. For the many small matrices of training that is also the fastest.
    The limit holds for the whole process. Libraries that cannot be limited (Accelerate on macOS) are left as they are.
    """
    from threadpoolctl import threadpool_limits

    _load()
    with threadpool_limits(1, user_api="blas"):
        yield


def blas_kernels() -> list[str]:
    """Return the name, version and processor of each BLAS in use, in alphabetical order.

    Two machines, or two settings of ``OPENBLAS_CORETYPE``, round differently where these differ.
    """
    return sorted(f"{each['internal_api']} {each['version']} {each.get('architecture')}" for each in _loaded())


def _loaded() -> list[dict[str, Any]]:
    from threadpoolctl import threadpool_info

    _load()
    return [each for each in threadpool_info() if each["user_api"] == "blas" and "opencv" not in each["filepath"]]


def _load() -> None:
    """Load NumPy's library and SciPy's, which is another copy: only what is loaded can be limited or named."""
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401
