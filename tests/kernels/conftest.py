"""Kernels that have two forms are tested in both: NumPy's, and the compiled one, which runs where numba is loaded."""

import sys

import pytest

from lipmotion.kernels import compiler


def load_numba(patch: pytest.MonkeyPatch, is_compiled: bool) -> None:
    """Make short recordings be computed in the compiled form, or in NumPy's."""
    numba = pytest.importorskip("numba")
    assert compiler.numba_works()
    if is_compiled:
        patch.setitem(sys.modules, "numba", numba)
    else:
        patch.delitem(sys.modules, "numba")


@pytest.fixture(params=["numpy", "compiled"])
def form(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    load_numba(monkeypatch, request.param == "compiled")
    return request.param
