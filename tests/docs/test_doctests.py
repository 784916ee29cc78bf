"""The examples in docstrings run from the root of the repository, with the shipped model and examples/welcome.flac."""

from __future__ import annotations

import doctest
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import lipmotion
from lipmotion.speech.recognition.recognised_speech import Recognition
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.types import Audio, Features, ParallelMap

ROOT = Path(__file__).parents[2]


def homes() -> Iterator[tuple[str, object, str]]:
    """Yield the name, the value and the module of everything public."""
    for name in lipmotion.__all__:
        value = inspect.unwrap(getattr(lipmotion, name))
        yield name, value, value.__module__


def documented() -> dict[str, doctest.DocTest]:
    """Return the docstrings with examples of all public names, their modules and the package, by name."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    modules = [import_module(name) for name in sorted({"lipmotion", *(home for _, _, home in homes())})]
    tests = [test for module in modules for test in finder.find(module, module.__name__)]
    for name, value, home in homes():  # the finder does not look behind decorators
        tests += finder.find(value, f"{home}.{name}", import_module(home))
    return {test.name: test for test in tests if test.examples}


EXAMPLES = documented()


@pytest.fixture(scope="module", autouse=True)
def recognised_once() -> Iterator[None]:
    """Most docstrings recognise examples/welcome.flac by the shipped model: it is done once."""
    known: dict[tuple[int, str, bytes], Recognition] = {}
    plain = Recogniser.recognition

    def recognition(
        self: Recogniser, audio: Audio, features: Features, each: ParallelMap = map, *, english: bool = True
    ) -> Recognition:
        key = id(self.own), self.kind, audio.samples.tobytes()
        if self.adaptation is not None:
            return plain(self, audio, features, each, english=english)
        if key not in known:
            known[key] = plain(self, audio, features, each, english=english)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recogniser, "recognition", recognition)
        yield


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_the_examples_of_a_docstring_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    reports: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(EXAMPLES[name], out=reports.append)
    assert result.failed == 0, "".join(reports)


def test_every_public_name_has_an_example() -> None:
    assert [name for name, _, home in homes() if f"{home}.{name}" not in EXAMPLES] == []
