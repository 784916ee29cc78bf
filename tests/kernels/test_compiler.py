import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier
from typing import Any, cast

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from children import environment, run_child
from kernels.conftest import load_numba
from kernels.networks import network_posteriors, phone_loop
from lipmotion.kernels import banded, compiler, factorial, factorial_loops, forward_backward
from lipmotion.kernels.compiler import limit_threads
from lipmotion_faces.kernels import affine, painting, raster, shading
from lipmotion_faces.kernels.textured import CLEAR, SOLID, TexturedTriangles, draw_textured

TESTS = Path(__file__).parents[1]


@pytest.fixture
def unused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process in which numba can be imported but was not."""
    load_numba(monkeypatch, False)


@pytest.mark.usefixtures("unused")
def test_long_recordings_are_compiled_and_short_ones_only_where_numba_is_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert not compiler.pays(compiler.LONG_FRAMES // 2)
    assert compiler.pays(compiler.LONG_FRAMES * 2)
    monkeypatch.setitem(sys.modules, "numba", cast("Any", None))
    assert compiler.pays()


def sequences() -> list[np.ndarray]:
    """Return what the kernels of sequences make of small, random input."""
    random = np.random.default_rng(0)
    stay, ends = random.uniform(0.3, 0.9, (2, 3)), np.full((2, 3), 1 / 6)
    loop = factorial_loops.Loop(stay, 1 - stay[:1], 1 - stay[1], random.dirichlet(np.ones(3), 3), ends, ends)
    logs = [random.normal(-20, 2, (4, 6)).astype(np.float32) for _ in range(2)]
    found: list[Any] = []
    for kind in (np.float32, np.float64):
        pairs = np.empty((4, 0), kind), np.empty((0, 2), np.intp)
        given = factorial_loops.FactorialLogLikelihoods(*(log.astype(kind) for log in logs), *pairs)
        posteriors = factorial.infer_factorial(loop, loop, given, 2)
        found += [*posteriors[:2], *posteriors.audio_counts, posteriors.log_likelihood]
        found += factorial_loops.find_factorial_path(loop, loop, given)
        arrays, _ = phone_loop(1, units=9, states=2)
        found += network_posteriors(random.normal(-20, 4, (3, len(arrays["emission"]))).astype(kind), **arrays)
    log_emission, moves = random.normal(0, 3, (5, 2, 3)), np.log(random.uniform(0.2, 0.8, (2, 2, 3)))
    found += forward_backward.chain_posteriors(log_emission, *moves, np.array([5, 4]), np.array([3, 2]))
    found += banded.solve_mlpg(*random.uniform(0.5, 1, (2, 4, 3, 2)))
    return found


def pictures() -> list[np.ndarray]:
    """Return what the kernels of pixels draw of small, random input."""
    random = np.random.default_rng(1)
    points, finishes = random.uniform([0, 0, -2], [16, 12, -1], (9, 3)), random.uniform(0, 1, (2, 7))
    vertices = [random.normal(size=shape) for shape in ((9, 3), (9, 3), 3, (9, 3), (9, 2), (9, 3))]
    light = np.abs(shading.shade(*vertices, random.integers(0, 2, 9), finishes, random.uniform(0, 1, (6, 6))))
    triangles = random.integers(0, 9, (20, 3)).astype(np.int32)
    plain, textured, frame, moved = (np.zeros((12, 16, 3), np.uint8) for _ in range(4))
    opacity, behind, tone = np.zeros((12, 16), np.uint8), np.zeros((12, 16, 3), np.float32), np.arange(256).astype("u1")
    raster.draw(points, light, triangles, (0, 0, 16, 12), behind, tone, plain)
    looks = np.array([[0, SOLID], [0, CLEAR]] * 10, np.int32)
    texels = random.integers(0, 65536, (16, 4)).astype(np.uint16)
    surface = TexturedTriangles(
        triangles, random.uniform(0, 1, (20, 3, 2)), looks, np.full((20, 2), 0.7), texels, np.array([[0, 4, 4]])
    )
    draw_textured(points, light, light / 2, surface, (0, 0, 16, 12), behind, tone, textured, opacity)
    to_source = np.array([[0.7, -0.1, 2.3], [0.12, 0.68, -3.6]])
    affine.blend(frame, (1, 2), (9, 8), plain, random.uniform(0, 1, (12, 16)).astype(np.float32), to_source)
    layer, target = np.zeros((12, 16, 4), np.float32), np.zeros((12, 16, 4), np.float32)
    heights, shifts = random.uniform(0, 6, (3, 16)), random.normal(0, 2, (2, 4, 5))
    painting.paint_band(layer, heights, heights + 4, np.linspace(0, 1, 16), random.uniform(0, 1, (3, 4, 4)))
    painting.warp(layer, *shifts, 4, target)
    painting.warp_bytes(random.integers(0, 256, (12, 16, 4), np.uint16), *shifts, 4, moved)
    stacked = np.zeros((12, 16, 4), np.uint16)
    painting.stack(layer, layer, np.dstack([layer, layer[..., 0]]) / 255, target, stacked)
    drawn = [light, plain, textured, opacity, frame, layer, target, moved, stacked]
    return [*drawn, affine.resample(plain[None], to_source, (5, 6)), shading.sum_normals(points, triangles)]


@pytest.mark.long
def test_without_numba_kernels_run_as_python_and_say_so_once(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    code = """
import sys
sys.modules["numba"] = None  # importing it fails
import numpy as np
from kernels.test_compiler import pictures, sequences
np.savez(sys.argv[1], *sequences(), *pictures())
"""
    told = run_child([sys.executable, "-c", code, tmp_path / "python.npz"], variables=environment(
        PYTHONPATH=f"{Path(compiler.__file__).parents[2]}:{TESTS}"), check=True).stderr  # fmt: skip
    assert [line for line in told.splitlines() if line] == [told.strip()]
    assert "numba is not installed" in told
    with np.load(tmp_path / "python.npz") as python:
        wanted = [*sequences(), *pictures()]
        assert len(wanted) == len(python.files)
        for name, values in zip(python.files, wanted, strict=True):
            assert np.any(values), name
            close = {"f": 1e-3, "B": 0}.get(np.asarray(values).dtype.char, 1e-5)
            levels = 3 if np.asarray(values).dtype == np.uint8 else close  # as ``warp_bytes`` rounds
            np.testing.assert_allclose(python[name], values, rtol=close, atol=levels, err_msg=name)


@pytest.mark.parametrize(
    "code",
    [
        "import lipmotion",
        "from lipmotion.cli import command_line",
        "from lipmotion.kernels import banded, factorial, network, paths; from lipmotion_faces.kernels import painting",
        "import lipmotion; lipmotion.animate('examples/welcome.flac')",
    ],
)
@pytest.mark.long
def test_numba_stays_away_from_small_work(code: str, pytestconfig: pytest.Config) -> None:
    code += "\nimport sys; sys.exit('numba' in sys.modules)"
    run_child([sys.executable, "-c", code], folder=pytestconfig.rootpath, check=True)


def halves(x: float) -> float:
    return x / 2


def test_compiled_code_is_kept_on_disk_where_it_can_be():
    pytest.importorskip("numba")
    function = cast("Any", compiler.compiled(halves))
    assert function(3.0) == 1.5
    assert function.kernel.stats.cache_path is not None
    places: dict = {}
    exec(compile("def double(x):\n    return 2 * x\n", "nowhere", "exec"), places)  # noqa: S102  (no file, no cache)
    unkept = compiler.compiled(places["double"])
    assert unkept(3.0) == 6.0
    assert unkept.kernel.stats.cache_path is None


def _sum(a: float, b: float) -> float:
    return a + b


def keep_in(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a kernel whose machine code is kept in a folder."""
    numba = pytest.importorskip("numba")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
    numba.config.reload_config()
    kernel = cast("Any", compiler.compiled(_sum))
    kernel.prepare()
    return kernel


@pytest.mark.long
def test_a_damaged_cache_is_written_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert keep_in(tmp_path, monkeypatch)(1.0, 2.0) == 3.0
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    assert {path.suffix for path in files} == {".nbi", ".nbc"}
    for suffix in (".nbi", ".nbc"):
        for damage in (b"", b"\xe9rubbish", None):
            for path in (path for path in files if path.suffix == suffix):
                path.write_bytes(path.read_bytes()[:-1] if damage is None else damage)
            again, after = cast("Any", compiler.compiled(_sum)), cast("Any", compiler.compiled(_sum))
            assert again(1.0, 2.0) == after(1.0, 2.0) == 3.0
            assert not again.kernel.stats.cache_hits, "it was damaged"
            assert after.kernel.stats.cache_hits, "it is whole again"


def threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture
def two_outside():
    with threadpool_limits(2, user_api="blas"):
        yield


@pytest.mark.usefixtures("two_outside")
def test_one_inside_and_as_before_afterwards_also_after_an_error():
    with limit_threads():
        assert threads() == {1}
        with limit_threads():
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(KeyError), limit_threads():
        raise KeyError
    assert threads() == {2}
    counted = limit_threads()(threads)
    assert [counted(), counted()] == [{1}, {1}]


@pytest.mark.usefixtures("two_outside")
def test_blocks_that_overlap_in_threads_of_python_leave_nothing_behind():
    """The second begins inside the first and ends after it."""
    both_in, first_out = Barrier(2), Barrier(2)

    def first():
        with limit_threads():
            both_in.wait(20)
        first_out.wait(20)

    def second():
        with limit_threads():
            both_in.wait(20)
            first_out.wait(20)

    with ThreadPoolExecutor(2) as pool:
        for job in [pool.submit(first), pool.submit(second)]:
            job.result()
    assert threads() == {2}
