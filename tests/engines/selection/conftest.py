"""A small model of recorded units, trained once."""

import pytest

from lipmotion.engines.selection.costs import SelectionConfig
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.testing.examples import examples
from lipmotion.types import silent_monitor

SETTINGS = SelectionConfig(joint_recogniser=False, articulation=False, closures=False)


@pytest.fixture(scope="session")
def engine() -> SelectionEngine:
    """An engine that shows recordings as they are."""
    return SelectionEngine(SETTINGS)


@pytest.fixture(scope="session")
def model(engine: SelectionEngine) -> SelectionModel:
    """A model of the synthetic examples."""
    return engine.fit(examples(), silent_monitor).model
