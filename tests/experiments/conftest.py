from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import pytest

from lipmotion.measures.curves import bootstrap_interval
from lipmotion.testing import examples as sentences
from lipmotion.types import Example
from lipmotion_lab.evaluation import evaluate as evaluation_figures


@pytest.fixture(scope="package", autouse=True)
def few_draws() -> Iterator[None]:
    """Bootstrap intervals of 50 draws, for speed; their values are tested with the measures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation_figures, "bootstrap_interval", partial(bootstrap_interval, draws=50))
        yield


@pytest.fixture(scope="module")
def examples() -> list[Example]:
    """Twelve sentences whose last frames are not valid, and have wrong values."""
    made = []
    for one in sentences(12):
        valid = one.valid.copy()
        valid[-8:] = False
        one.motion.values[-8:] = 9
        made.append(replace(one, valid=valid))
    return made
