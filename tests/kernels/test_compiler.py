import pytest

pytest.importorskip("numba")

from lipmotion.kernels.compiled.compiler import compiled


def halves(x: float) -> float:
    return x / 2


def test_compiled_code_is_kept_on_disk():
    function = compiled(halves)
    assert function(3.0) == 1.5
    assert function.stats.cache_path is not None


def test_what_cannot_be_kept_is_compiled_all_the_same():
    places: dict = {}
    exec(compile("def double(x):\n    return 2 * x\n", "nowhere", "exec"), places)  # noqa: S102  (no file, no cache)
    function = compiled(places["double"])
    assert function(3.0) == 6.0
    assert function.stats.cache_path is None
