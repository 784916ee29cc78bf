import pytest

pytest.importorskip("numba")

from lipmotion.kernels.compiled.compiler import compiled


def halves(x: float) -> float:
    return x / 2


def test_compiled_code_is_kept_on_disk():
    function = compiled(halves)
    assert function(3.0) == 1.5
    assert function.stats.cache_path is not None
