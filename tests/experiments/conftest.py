from dataclasses import replace

import pytest

from lipmotion.testing import examples as sentences
from lipmotion.types import Example


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
