"""Examples, corpora that differ from the toy corpus in one way, and what experiments share."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from lipmotion import Corpus
from lipmotion.testing import examples as sentences
from lipmotion.types import Channel, Example, Utterance
from lipmotion_lab import hofer2008
from lipmotion_lab.runner import ExperimentSettings
from testing.toy import SMALL

SETTINGS = ExperimentSettings(recogniser=SMALL)


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


def copied(corpus: Corpus, folder: Path, change: Callable[[Utterance], Utterance]) -> Corpus:
    result = Corpus.create(folder / "copy")
    for name in corpus.names():
        result.add(change(corpus.utterance(name)))
    return result


def renamed(corpus: Corpus, folder: Path, *names: str) -> Corpus:
    """Return a copy of the corpus with the first channels under other names, and without the others."""

    def change(utterance: Utterance) -> Utterance:
        motion = utterance.track.motion
        channels, values = tuple(map(Channel, names)), motion.values[:, : len(names)]
        return replace(
            utterance, track=replace(utterance.track, motion=replace(motion, channels=channels, values=values))
        )

    return copied(corpus, folder, change)
