"""The examples in docstrings run where ``examples`` and a corpus, ``my-corpus``, are."""

import doctest
import inspect
import shutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import lipmotion

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


@pytest.mark.usefixtures("recognised_once")
@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_the_examples_of_a_docstring_run(name, toy_corpus, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copytree(toy_corpus.path, tmp_path / "my-corpus")
    monkeypatch.chdir(tmp_path)
    reports: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(EXAMPLES[name], out=reports.append)
    assert result.failed == 0, "".join(reports)


def test_every_public_name_has_an_example():
    assert [name for name, _, home in homes() if f"{home}.{name}" not in EXAMPLES] == []
