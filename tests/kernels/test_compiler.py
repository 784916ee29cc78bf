"""Compiled kernels are kept on disk; a cache that is damaged or takes nothing is not noticed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

pytest.importorskip("numba")

import numba
from numba.core.caching import IndexDataCacheFile

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


def _sum(a: float, b: float) -> float:
    return a + b


@pytest.mark.long
def test_a_damaged_cache_is_written_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert compiled(_sum)(1.0, 2.0) == 3.0
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    assert {path.suffix for path in files} == {".nbi", ".nbc"}
    for suffix in (".nbi", ".nbc"):
        for damage in (b"", b"\xe9rubbish", None):
            for path in (path for path in files if path.suffix == suffix):
                path.write_bytes(path.read_bytes()[:-1] if damage is None else damage)
            again, after = cast("Any", compiled(_sum)), cast("Any", compiled(_sum))
            assert again(1.0, 2.0) == after(1.0, 2.0) == 3.0
            assert not again.stats.cache_hits, "it was damaged"
            assert after.stats.cache_hits, "it is whole again"


@pytest.mark.long
def test_a_cache_that_takes_nothing_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    kernel = compiled(_sum)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "save", full)
    assert kernel(1.0, 2.0) == 3.0
