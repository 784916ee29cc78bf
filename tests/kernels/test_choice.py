import sys

import numpy as np
import pytest

from children import run_child
from lipmotion.kernels import choice


@pytest.fixture
def unused(monkeypatch) -> None:
    """A process that has used no kernel yet, in which numba can be imported but was not."""
    monkeypatch.setattr(choice, "_requested_s", [0.0])
    monkeypatch.setattr(choice, "numba_works", lambda: True)
    monkeypatch.delitem(sys.modules, "numba", raising=False)


@pytest.mark.usefixtures("unused")
def test_much_work_is_compiled_and_little_is_not():
    assert not choice.compiled_pays(choice.START_UP_S / 2)
    assert choice.compiled_pays(choice.START_UP_S * 2)


@pytest.mark.usefixtures("unused")
def test_little_work_again_and_again_is_compiled_in_the_end():
    answers = [choice.compiled_pays(choice.START_UP_S / 4) for _ in range(8)]
    assert answers == sorted(answers)
    assert answers.count(False) == 4


@pytest.mark.usefixtures("unused")
def test_all_work_is_compiled_where_numba_is_loaded(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    assert choice.compiled_pays(0.0)


def test_without_numba_a_picture_is_drawn_by_python(tmp_path):
    code = """
import sys
if sys.argv[2] == "none":
    sys.modules["numba"] = None  # importing it fails
import numpy as np
from lipmotion.kernels.pixels.raster import draw
from lipmotion.kernels.pixels.shading import shade
random = np.random.default_rng(0)
picture, behind = np.zeros((12, 16, 3), np.uint8), np.zeros((12, 16, 3), np.float32)
points, finishes = random.uniform([0, 0, 0], [16, 12, 1], (9, 3)), random.uniform(0, 1, (2, 7))
given = (random.normal(size=shape) for shape in ((9, 3), (9, 3), 3, (9, 3), (9, 2), (9, 3)))
light = shade(*given, random.integers(0, 2, 9), finishes, random.uniform(0, 1, (6, 6)))
triangles = random.integers(0, 9, (20, 3)).astype(np.int32)
draw(points, np.abs(light), triangles, (0, 0, 16, 12), behind, np.arange(256).astype(np.uint8), picture)
np.savez(sys.argv[1], light, picture)
"""
    told = [
        run_child([sys.executable, "-c", code, tmp_path / f"{n}.npz", n], check=True).stderr for n in ("none", "it")
    ]
    assert ["numba" in each for each in told] == [True, False]
    python, compiled = (np.load(tmp_path / f"{name}.npz") for name in ("none", "it"))
    assert python["arr_1"].any()
    assert all(np.array_equal(python[name], compiled[name]) for name in python.files)


def test_without_numba_all_work_is_numpys():
    code = """
import sys
sys.modules["numba"] = None  # importing it fails
import numpy as np
from lipmotion.kernels.sequences import banded
from lipmotion.kernels.choice import compiled_pays
assert not compiled_pays(1e9)
assert banded.generate(np.ones((4, 3, 2)), np.ones((4, 3, 2)))[0].shape == (4, 2)
"""
    run_child([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    "code",
    [
        "import lipmotion",
        "from lipmotion.cli import command_line",
        "from lipmotion.kernels.sequences import banded, forward_backward, viterbi",
        "import lipmotion; lipmotion.animate('examples/welcome.flac')",
    ],
)
@pytest.mark.long
def test_numba_stays_away_from_small_work(code, pytestconfig):
    code += "\nimport sys; sys.exit('numba' in sys.modules)"
    run_child([sys.executable, "-c", code], folder=pytestconfig.rootpath, check=True)
