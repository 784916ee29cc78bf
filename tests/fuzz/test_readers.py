"""Every reader with its good inputs, some mutations of them, and all inputs that once showed defects."""

from pathlib import Path
from random import Random

import pytest

from fuzz.floods import FLOODS
from fuzz.inputs import Files, picked_up
from fuzz.judge import READ, REFUSED
from fuzz.mutators import mutated
from fuzz.readers import READERS
from fuzz.worker import Worker

FOUND = Path(__file__).parent / "found"
FOLDERS = sorted(path for path in FOUND.glob("*/*") if path.is_dir())
ROUNDS = 12
LONG = ("live",)  # readers that have much to prepare, or to do
INPUTS = {"model": 4, "face": 4, "video": 6, "transcript": 8, "lexicon": 8, "character": 4}
"""Numbers of changed inputs of slower readers."""


@pytest.mark.parametrize("name", [pytest.param(each, marks=[pytest.mark.long] * (each in LONG)) for each in READERS])
def test_good_input_is_read_and_changed_input_read_or_refused(name, worker, good):
    """The same changes every time; ``python -m fuzz`` goes further."""
    seeds = READERS[name].seeds(good)
    results = [worker.read_input(name, files) for files in seeds]
    assert {result.kind for result in results} <= {READ, REFUSED}, results
    assert results[0].kind == READ, results[0]
    assert sum(result.kind == READ for result in results) > len(results) / 2
    chance = Random(f"1 {name}")
    for _ in range(INPUTS.get(name, ROUNDS)):
        _check(worker, name, mutated(chance, chance.choice(seeds), chance.choice(seeds)))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: f"{folder.parent.name}: {folder.name}")
def test_what_was_found_once(folder, worker):
    _check(worker, folder.parent.name, picked_up(folder))


@pytest.mark.long
@pytest.mark.parametrize(("name", "flood"), FLOODS, ids=lambda part: part)
def test_a_flood_that_was_found_once(name, flood, worker):
    _check(worker, name, FLOODS[name, flood]())


@pytest.mark.long
def test_all_that_was_found_is_of_a_reader():
    assert FOLDERS
    assert {folder.parent.name for folder in FOLDERS} <= READERS.keys()


def _check(worker: Worker, name: str, files: Files) -> None:
    result = worker.read_input(name, files)
    assert result.kind in (READ, REFUSED), f"{result.kind} {result.where}\n{result.detail}"
