"""A small model of recorded units, trained once."""

from typing import Any

import pytest

from lipmotion.engines import engine_named
from lipmotion.testing import examples
from lipmotion.types import silent_monitor


@pytest.fixture(scope="session")
def engine() -> Any:
    """An engine that shows recordings as they are."""
    return engine_named("selection", {"joint_recogniser": False, "articulation": False, "closures": False})


@pytest.fixture(scope="session")
def model(engine) -> Any:
    """A model of the synthetic examples."""
    return engine.fit(examples(), silent_monitor).model
