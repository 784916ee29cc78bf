from pathlib import Path

import pytest

from formats.examples import of_motion
from lipmotion import Model, animate
from lipmotion.types import Generation
from meshes.speech import motion, units


@pytest.fixture(scope="session")
def generation() -> Generation:
    """The made-up sentence of ``meshes.speech``. Do not change it."""
    return of_motion(motion(), units())


@pytest.fixture(scope="session")
def result(toy_model: Model, toy_speech: Path) -> Generation:
    return animate(toy_speech, model=toy_model)
