import sys

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
