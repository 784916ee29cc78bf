"""NumPy or compiled: the one rule that decides.

Every kernel has a NumPy form and most have a compiled one (``kernels.compiled``). numba costs ``START_UP_S`` in a new
process, so work is done by NumPy until what a process has asked for would have taken that long; from then on, or where
numba is loaded already, by the compiled forms; without numba always by NumPy. So nobody waits more than twice as long
as with the better choice, whatever comes. Forms that are chosen between give the same bits: what happened before in a
process changes no result.
"""

from __future__ import annotations

import sys
from functools import cache

START_UP_S = 1.0
"""At most, importing numba and loading kernels that were compiled before (docs/results/kernels.md); the first run on a
machine compiles them, for some seconds."""
_asked_s = [0.0]


def compiled_pays(numpy_s: float) -> bool:
    """Return whether the compiled form of a kernel should be taken.

    numpy_s : what the NumPy form would take, in seconds, roughly
    """
    _asked_s[0] += numpy_s
    return (_asked_s[0] > START_UP_S or "numba" in sys.modules) and numba_works()


@cache
def numba_works() -> bool:
    """Return whether numba can be imported (it is imported by asking)."""
    try:
        import numba  # noqa: F401
    except ImportError:  # not installed, or not made for this NumPy
        return False
    return True
