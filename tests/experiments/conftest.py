from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from lipmotion.measures.curves import bootstrap_interval
from lipmotion_lab.evaluation import evaluate as evaluation_figures


@pytest.fixture(scope="package", autouse=True)
def few_draws() -> Iterator[None]:
    """Bootstrap intervals of 50 draws, for speed; their values are tested with the measures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation_figures, "bootstrap_interval", partial(bootstrap_interval, draws=50))
        yield
