"""Rules of the design, and of the tests themselves, that no linter checks."""

import ast
import json
import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

from portable.run import NUMERIC

SOURCE = Path(__file__).parents[2] / "src"
EMPTY_NAMES = {"utils", "util", "helpers", "helper", "common", "core", "misc"}  # module names without meaning
PICKLES = {"pickle", "shelve", "marshal", "dill"}
Rule = Callable[[str], Iterator[int]]


@lru_cache(maxsize=1)  # the trees of all modules are 200 MB
def nodes(text: str) -> list[ast.AST]:
    """Return all nodes of a module."""
    return list(ast.walk(ast.parse(text)))


def calls(text: str, *last_names: str) -> Iterator[tuple[ast.Call, str]]:
    """Give calls of functions whose last name begins with one of some, with their whole names."""
    for node in nodes(text):
        if isinstance(node, ast.Call):
            last = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if last.startswith(last_names):
                yield node, ast.unparse(node.func)


def pickled(text: str) -> Iterator[int]:
    """Nothing that runs code when it is read."""
    for node in nodes(text):
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = {alias.name for alias in node.names} | {getattr(node, "module", "")}
            of_joblib = {"load", "dump"} & modules and getattr(node, "module", "") == "joblib"
            if modules & PICKLES or of_joblib or "joblib" in {alias.name for alias in node.names}:
                yield node.lineno
    for call, name in calls(text, "load", "read_array"):
        if name in ("np.load", "np.lib.format.read_array") and "allow_pickle=False" not in ast.unparse(call):
            yield call.lineno


def changeable(text: str) -> Iterator[int]:
    """The data that flows is frozen."""
    for node in nodes(text):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            written = " ".join(map(ast.unparse, node.decorator_list))
            if written.startswith("dataclass") and "frozen=True" not in written:
                yield node.lineno


def printed(text: str) -> Iterator[int]:
    """A library does not print, and one module of the command line prints for all: it knows what a terminal obeys."""
    for call, name in calls(text, "print", "write"):
        if name == "print" or re.fullmatch(r"sys\.(__)?std(out|err)(__)?\.write.*", name):
            yield call.lineno


def by_chance(text: str) -> Iterator[int]:
    """Chance comes from ``np.random.default_rng(seed)``; hidden states are found by ruff (NPY002, S311)."""
    return (call.lineno for call, name in calls(text, "default_rng") if not call.args)


def test_rules_are_kept() -> None:
    rules = (pickled, changeable, by_chance, printed)
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        text, name = path.read_text(encoding="utf-8"), path.relative_to(SOURCE).as_posix()
        found += [(rule, name, line) for rule in rules for line in rule(text)]
    printing = [(rule, name) for rule, name, _ in found if rule is printed]
    assert {*printing} == {(printed, "lipmotion/cli/terminal/printing.py")}
    assert len(found) == len(printing), [each for each in found if each[0] is not printed]


OFFENCES: list[tuple[Rule, str, list[int]]] = [
    (pickled, "import pickle\n", [1]),
    (pickled, "from joblib import load\n", [1]),
    (pickled, "from joblib import Parallel, delayed\n", []),
    (pickled, "np.load(path)\n", [1]),
    (pickled, "np.load(path, allow_pickle=False)\njson.load(file)\n", []),
    (changeable, "@dataclass(eq=False)\nclass A: ...\n", [2]),
    (changeable, "@dataclass(frozen=True)\nclass A: ...\n", []),
    (printed, "print(1)\n", [1]),
    (printed, "import sys\nsys.stdout.write('a')\nsys.__stderr__.writelines([])\nsys.stdout.flush()\n", [2, 3]),
    (by_chance, "rng = np.random.default_rng()\n", [1]),
    (by_chance, "rng = np.random.default_rng(seed)\nrng.normal(3)\n", []),
]


def test_a_rule_finds_what_breaks_it() -> None:
    for rule, text, lines in OFFENCES:
        assert list(rule(text)) == lines, text


def test_names_say_something() -> None:
    names = {part for path in SOURCE.rglob("*.py") for part in path.relative_to(SOURCE).with_suffix("").parts}
    assert not names & EMPTY_NAMES


def test_a_class_name_has_one_meaning() -> None:
    places: dict[str, list[str]] = {}
    for path in sorted(SOURCE.rglob("*.py")):
        for name in re.findall(r"^class (\w+)", path.read_text(encoding="utf-8"), re.MULTILINE):
            places.setdefault(name, []).append(str(path.relative_to(SOURCE)))
    assert len(places) > 200
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


TESTS = Path(__file__).parents[1]


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
