from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, animate
from lipmotion.types import Generation, StateTrace
from meshes.speech import motion, units


@pytest.fixture(scope="session")
def generation() -> Generation:
    """The made-up sentence of ``meshes.speech``. Do not change it."""
    moved = motion()
    trace = StateTrace(("a",), np.zeros(len(moved.values), np.intp))
    return Generation(moved, np.zeros(moved.values.shape), units(), trace)


@pytest.fixture(scope="session")
def result(toy_model: Model, toy_speech: Path) -> Generation:
    return animate(toy_speech, model=toy_model)
