"""Rules of the tests themselves."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

from portable.run import NUMERIC

TESTS = Path(__file__).parents[1]
STARTERS = re.compile(r"os\.(fork\w*|system|popen|spawn\w+|posix_spawnp?|exec[lv]\w*)|\w+\.create_subprocess_\w+")
MODULES = {"subprocess", "pty"}
ALLOWED = {"children.py"}
"""The one module that starts processes; the fuzzer's own start by ``multiprocessing``, and are watched by it."""


def starts(text: str) -> Iterator[int]:
    """Give the lines of a program that could start a process other than by ``children``."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            named = {alias.name for alias in node.names} | {getattr(node, "module", "")}
            if named & MODULES:
                yield node.lineno
        elif isinstance(node, ast.Call) and STARTERS.fullmatch(ast.unparse(node.func)):
            yield node.lineno


def test_children_are_started_in_one_place() -> None:
    found = {
        str(path.relative_to(TESTS)): lines
        for path in sorted(TESTS.rglob("*.py"))
        if (lines := list(starts(path.read_text(encoding="utf-8"))))
    }
    assert found.keys() == ALLOWED, found


def test_the_rule_finds_what_breaks_it() -> None:
    for text in ("import subprocess", "def f():\n    from subprocess import run", "os.system('a')", "os.fork()"):
        assert list(starts(text)), text
    assert list(starts("from children import run_child\nrun_child(['a'])\nos.execute = 1\n")) == []


def test_planted_faults_still_fit_the_source() -> None:
    root = TESTS.parent
    mutants = json.loads((root / "benchmarks" / "mutants.json").read_text(encoding="utf-8"))
    assert len(mutants) > 100
    for mutant in mutants:
        places = (root / package / mutant["path"] for package in ("src/lipmotion", "src", ""))
        text = next(place for place in places if place.is_file()).read_text(encoding="utf-8")
        assert text.count(mutant["old"]) == 1, mutant["name"]
        assert all((root / test.partition("::")[0]).exists() for test in mutant.get("tests", ())), mutant["name"]


def test_the_tests_of_rounding_are_there() -> None:
    """Else ``make test-portable`` runs none."""
    assert [name for name in NUMERIC if not (TESTS / name).exists()] == []
