import numpy as np
import pytest

from lipmotion.types import Generation, StateTrace
from meshes.speech import motion, units


@pytest.fixture(scope="session")
def generation() -> Generation:
    """The made-up sentence of ``meshes.speech``. Do not change it."""
    moved = motion()
    trace = StateTrace(("a",), np.zeros(len(moved.values), np.intp))
    return Generation(moved, np.zeros(moved.values.shape), units(), trace)
