"""The rule by which kernels choose between NumPy and their compiled form.

What a short line needs has a NumPy form, and most of it a compiled one as well (``kernels.compiled``). Loading numba
takes ``START_UP_S`` in a new process, so NumPy is used until the requested work would have taken that long in all; from
then on, or where numba is loaded already, the compiled forms are used; without numba always NumPy. So no process takes
more than twice as long as with the better choice. The forms that are chosen between give the same bits: results do not
depend on the history of a process. What draws heads, meshes and planes has the compiled form alone.
"""

from __future__ import annotations

import sys
from functools import cache

START_UP_S = 1.0
"""Longest time of importing numba and loading kernels that were compiled before (docs/results/kernels.md); the first
run on a machine also compiles them, for some seconds."""
_requested_s = [0.0]


def compiled_pays(numpy_s: float) -> bool:
    """Return whether to use the compiled form of a kernel.

    numpy_s : estimated time of the NumPy form, in seconds
    """
    _requested_s[0] += numpy_s
    return (_requested_s[0] > START_UP_S or "numba" in sys.modules) and numba_works()


def expect_more() -> None:
    """Use the compiled forms from now on: more of the same work will follow, as in an interactive program."""
    _requested_s[0] += START_UP_S


@cache
def numba_works() -> bool:
    """Return whether numba can be imported; this imports it."""
    try:
        import numba  # noqa: F401
    except ImportError:  # not installed, or not made for this NumPy
        return False
    return True
