"""The pages of the papers: what they say of equations, functions and tests is there."""

import re
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest

from docs.test_links import DOCS
from lipmotion.engines.coupled.model import CoupledConfig
from lipmotion.engines.joint.engine import JointEngineConfig
from lipmotion.engines.selection.costs import SelectionConfig

ROOT = DOCS.parent
SOURCE, CORE, TESTS = ROOT / "src", ROOT / "src" / "lipmotion", ROOT / "tests"
PAGES = {"hofer2008": 12, "xieliu2007": 21, "minnis2000": 0}
"""The pages, and how many equations each paper numbers, besides those of appendices."""
CONFIGURATIONS = (JointEngineConfig, CoupledConfig, SelectionConfig)
NAMED = re.compile(r"`((?:\w+/)+\w+\.py)::(\w+)`")
DEFINED = re.compile(r"^ *(?:(?:def|class) (\w+)|(\w+)(?:: [^=\n]+)? = )", re.MULTILINE)
FENCES = re.compile(r"```.*?```", re.DOTALL)


@cache
def defined(folder: Path) -> frozenset[str]:
    """Return the names of modules, functions, classes, constants and attributes in a folder."""
    paths = list(folder.rglob("*.py"))
    found = (name for path in paths for names in DEFINED.findall(path.read_text("utf-8")) for name in names)
    return frozenset(found) | {path.stem for path in paths} | {path.parent.name for path in paths}


def text(page: str) -> str:
    """Return a page without its commands."""
    return FENCES.sub("", (DOCS / "papers" / f"{page}.md").read_text("utf-8"))


def test_every_function_and_test_of_an_equation_exists():
    found = [match for page in PAGES for match in NAMED.findall(text(page))]
    assert len(found) > 10
    for path, name in found:
        (place,) = [root / path for root in (CORE, SOURCE, TESTS) if (root / path).is_file()]
        assert f"def {name}(" in place.read_text("utf-8"), (path, name)


def test_names_without_a_path_exist():
    names = [name for page in PAGES for name in re.findall(r"`([A-Za-z_][\w.]*)`", text(page))]
    tests = [name for name in names if name.startswith("test_")]
    functions = [name for name in names if "." in name]
    assert min(len(tests), len(functions)) > 20
    assert [name for name in tests if name not in defined(TESTS)] == []
    assert [name for name in functions if not defined(SOURCE).issuperset(name.split("."))] == []


def test_options_exist():
    options = {each.name for config in CONFIGURATIONS for each in fields(config)}
    pages = [(DOCS / "papers" / f"{page}.md").read_text("utf-8") for page in PAGES]
    named = [name for page in pages for name in re.findall(r"(?:`|--set \"?)(\w+)=", page)]
    assert len(named) > 10
    assert [name for name in named if name not in options] == []


@pytest.mark.parametrize("page", [page for page, count in PAGES.items() if count])
def test_every_equation_has_a_row_with_a_function_and_a_test(page):
    numbers = set()
    for row in re.findall(r"^\| (.+?) \|(.+`.+)\|(.*`.+`.*)\|$", text(page), re.MULTILINE):
        for first, last in re.findall(r"(?<![\w.])(\d+)(?:–(\d+))?(?![\w.])", re.sub(r"§[\d.]+|Fig. \d+", "", row[0])):
            numbers |= set(range(int(first), int(last or first) + 1))
    assert numbers.issuperset(range(1, PAGES[page] + 1)), sorted(set(range(1, PAGES[page] + 1)) - numbers)
