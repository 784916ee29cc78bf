from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from lipmotion.testing import examples as sentences
from lipmotion.types import Example
from lipmotion_lab import hofer2008


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


@contextmanager
def few_sets() -> Iterator[tuple[str, ...]]:
    """Let two unit sets of Hofer's table be trained, not five; give their names."""
    names = "eVis", "phone"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hofer2008, "PAPER_SCORES", {name: hofer2008.PAPER_SCORES[name] for name in names})
        yield names


def states(folder: Path) -> dict[str, int]:
    """Return when each file of a folder was written."""
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
