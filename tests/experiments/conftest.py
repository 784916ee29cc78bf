from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from lipmotion.experiments import comparison
from lipmotion.measures.bootstrap import interval
from lipmotion.pipeline.evaluation import evaluate as evaluation


@pytest.fixture(scope="package", autouse=True)
def few_draws() -> Iterator[None]:
    """Intervals of 50 draws: what they say is tested with the measures."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (comparison, evaluation):
            patch.setattr(module, "interval", partial(interval, draws=50))
        yield
