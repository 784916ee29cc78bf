"""The blocks of the page of the API and the examples in docstrings run."""

import doctest
import inspect
import pkgutil
import re
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import lipmotion
from children import FEW_STEPS, environment, run_child

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.long
def test_every_block_of_the_page_runs(toy_corpus, tmp_path):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copytree(toy_corpus.path, tmp_path / "my-corpus")
    done = run_child(
        [sys.executable, "-W", "error", "-c", "\n".join([FEW_STEPS, *BLOCKS])],
        folder=tmp_path,
        variables=environment(NUMBA_DISABLE_PERFORMANCE_WARNINGS="1"),
        check=True,
    )
    assert len(done.stdout.splitlines()) > len(BLOCKS)
    assert {"welcome.json", "welcome.csv", "welcome.tsv", "small.lipmotion"} <= {p.name for p in tmp_path.iterdir()}


def test_every_section_but_the_last_has_a_block():
    sections = PAGE.split("\n## ")[1:]
    assert len(sections) >= 7
    assert [section.splitlines()[0] for section in sections if "```python" not in section] == ["More"]


def test_the_names_in_its_tables_exist():
    named = re.findall(r"`(lipmotion(?:_\w+)?(?:\.\w+)+)`", PAGE)
    assert len(named) > 15
    for name in named:
        assert pkgutil.resolve_name(name) is not None


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
