from collections.abc import Iterator
from pathlib import Path

import pytest

from fuzz.inputs import Good
from fuzz.worker import Worker
from lipmotion import Corpus


@pytest.fixture(scope="session")
def good(toy_corpus: Corpus, toy_model_file: Path, coupled_model_file: Path) -> Good:
    return Good(toy_corpus.path, (toy_model_file, coupled_model_file))


@pytest.fixture(scope="module")
def worker(good: Good) -> Iterator[Worker]:
    with Worker(good) as process:
        yield process
