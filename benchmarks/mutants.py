"""Plant small bugs one at a time and see whether the tests notice.

    python benchmarks/mutants.py MUTANTS.json [--tree .] [--only NAME ...] [--tests PATH ...] [--rest] [--every]
                                 [--list] [-o RESULTS.json] [-- PYTEST OPTIONS]

MUTANTS.json is a list of objects: ``name``, ``path`` (below ``src/lipmotion``, ``src`` or the tree), ``old`` (text that
it holds once), ``new`` (what takes its place), and ``tests`` (files or folders of the tree: where a test should fail).

Each mutant gets a fresh copy of the tree, so the tree itself is never changed, and one run of pytest that stops at the
first failing test. A test that fails also without the mutant does not count: it is left out, and the run repeated.
With ``--rest``, the mutants that their own tests do not notice are planted together, all tests run once, and whatever
fails is tried on each of them alone. Only one pytest runs at a time.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

PACKAGES = Path("src"), Path("src") / "lipmotion", Path()
PARTS = """.ci CHANGELOG.md CITATION.cff CONTRIBUTING.md LICENSE Makefile README.md SECURITY.md benchmarks docs examples
extras pyproject.toml requirements scripts src tests""".split()
"""What tests may look at, as far as the tree has it."""
ALL = ("tests",)
SHARED = "shared"  # recordings beside the tree; the copy gets a link to them
PASSED, FAILED, BROKEN, NOTHING = 0, 1, 2, 5
"""Exit codes of pytest; ``BROKEN``: a test file cannot be imported, ``NOTHING``: no test was left to run."""
DID_NOT_END = "(did not end)"
PATIENCE_S = 60  # how long pytest may take to tell what failed so far
FAILURE = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


@dataclass(frozen=True)
class Mutant:
    """A small bug.

    path  : of the file, below ``src/lipmotion``, ``src`` or the tree
    old   : text that it holds exactly once
    new   : what takes its place
    tests : where a test should fail
    """

    name: str
    path: str
    old: str
    new: str
    tests: tuple[str, ...] = ALL

    def file_in(self, tree: Path) -> Path:
        """Return the file in a copy of the repository."""
        return next(path for folder in PACKAGES if (path := tree / folder / self.path).is_file())

    def planted(self, text: str) -> str:
        """Return a file's text with the bug in it. Raises SystemExit: the old text is not there exactly once."""
        count = text.count(self.old)
        if count != 1:
            raise SystemExit(f"{self.name}: {self.path} holds {self.old!r} {count} times, required once")
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant.

    caught    : a test fails that passes without it
    tests     : what was run on it; together with others, all tests
    first     : the first test that failed, empty if none
    first_s   : seconds until that was known, or until all had passed
    failing   : all that fail among the tests that were run; None: not counted
    failing_s : seconds that counting took
    unsound   : tests left out because they fail without the mutant as well
    """

    name: str
    path: str
    caught: bool
    tests: tuple[str, ...]
    first: str
    first_s: float
    failing: tuple[str, ...] | None = None
    failing_s: float = 0.0
    unsound: tuple[str, ...] = ()


@dataclass
class Tests:
    """The tests of one tree, and how they are run.

    tree    : what is copied
    options : of pytest, besides ``-x``
    limit_s : a run that takes longer counts as one that never ends
    unsound : tests that are known to fail without any mutant
    """

    tree: Path
    options: Sequence[str] = ()
    limit_s: float = 3600.0
    unsound: list[str] = field(default_factory=list)

    @contextmanager
    def copied(self, *mutants: Mutant) -> Iterator[Path]:
        """Give a copy of the tree with mutants in it."""
        with tempfile.TemporaryDirectory(prefix="mutant-") as folder:
            copy = Path(folder) / "tree"
            copy.mkdir()
            for part in PARTS:
                source = self.tree / part
                if source.is_dir():
                    shutil.copytree(source, copy / part)  # with times: what numba compiled stays valid
                elif source.exists():
                    shutil.copy2(source, copy / part)
            if (self.tree.parent / SHARED).exists():
                (Path(folder) / SHARED).symlink_to((self.tree.parent / SHARED).resolve())
            for mutant in mutants:
                file = mutant.file_in(copy)
                file.write_text(mutant.planted(file.read_text(encoding="utf-8")), encoding="utf-8")
            yield copy

    def failing(self, copy: Path, tests: Sequence[str], *arguments: str) -> list[str]:
        """Return the tests that fail in a copy, in the order in which they ran. Raises SystemExit: pytest cannot run.

        Those known as unsound are left out. The last is ``DID_NOT_END`` where the run took too long.
        """
        left_out = [f"--deselect={test}" for test in self.unsound]
        command = [sys.executable, "-m", "pytest", "-q", "-rfE", "--tb=no", "-p", "no:cacheprovider"]
        apart = f"--basetemp={copy.parent / 'pytest'}"
        environment = os.environ | {"PYTHONPATH": str(copy / "src"), "COLUMNS": "200"}
        with subprocess.Popen(
            [*command, apart, *self.options, *arguments, *left_out, *tests],
            cwd=copy, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", errors="replace", start_new_session=True,
        ) as process:  # fmt: skip
            try:
                said, ended = finished(process, self.limit_s)
            except BaseException:
                os.killpg(process.pid, signal.SIGKILL)
                raise
        found = list(dict.fromkeys(FAILURE.findall(said)))
        if not ended:
            return [*found, DID_NOT_END]
        if process.returncode == PASSED or (found and process.returncode in (FAILED, BROKEN)):
            return found
        if process.returncode == NOTHING and self.unsound:
            return []
        raise SystemExit(f"pytest ended with exit code {process.returncode}:\n{said[-2000:]}")

    def first(self, copy: Path, tests: Sequence[str], *arguments: str) -> str:
        """Return the first test that fails in a copy and passes in the tree itself, empty if there is none."""
        while found := self.failing(copy, tests, "-x", *arguments):
            if found[0] == DID_NOT_END or self.sound(found[0]):
                return found[0]
        return ""

    def sound(self, test: str) -> bool:
        """Whether a test passes without a mutant; one that does not is left out from now on."""
        with self.copied() as copy:
            passes = not self.failing(copy, [test])
        if not passes:
            self.unsound.append(test)
        return passes


def finished(process: subprocess.Popen[str], limit_s: float) -> tuple[str, bool]:
    """Return what a run of pytest says, and whether it has ended in time; else it is interrupted, as by Ctrl-C."""
    try:
        return process.communicate(timeout=limit_s)[0], True
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
    try:
        return process.communicate(timeout=PATIENCE_S)[0], False
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0], False


def main() -> int:
    """Print a line a mutant; return 1 if any survived."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it, and so would tests
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # pytest is to end with this process
    options = parsed()
    tree = options.tree.resolve()
    mutants = chosen(options, tree)
    if options.list:
        for mutant in mutants:
            print(f"{mutant.name}: {mutant.path}: {mutant.old!r} -> {mutant.new!r} ({' '.join(mutant.tests)})")
        return 0
    tests = Tests(tree, options.pytest, options.limit)
    outcomes: dict[str, Outcome] = {}
    for mutant in mutants:
        outcomes[mutant.name] = tried(mutant, tests, every=options.every)
        print(shown(outcomes[mutant.name]), flush=True)
        write(outcomes, options.output)
    survivors = [mutant for mutant in mutants if not outcomes[mutant.name].caught and mutant.tests != ALL]
    if options.rest and survivors:
        for outcome in together(survivors, tests):
            outcomes[outcome.name] = outcome
            print(shown(outcome), flush=True)
        write(outcomes, options.output)
    return int(not all(outcome.caught for outcome in outcomes.values()))


def chosen(options: argparse.Namespace, tree: Path) -> list[Mutant]:
    """Return the mutants to be tried. Raises SystemExit: one of them cannot be planted, or there is none."""
    entries = json.loads(options.mutants.read_text(encoding="utf-8"))
    mutants = [Mutant(**entry | {"tests": tuple(entry.get("tests", ALL))}) for entry in entries]
    unknown = set(options.only or ()) - {mutant.name for mutant in mutants}
    if unknown:
        raise SystemExit(f"no mutant {', '.join(sorted(unknown))}")
    mutants = [mutant for mutant in mutants if not options.only or mutant.name in options.only]
    for mutant in mutants:
        mutant.planted(mutant.file_in(tree).read_text(encoding="utf-8"))
    return [replace(mutant, tests=tuple(options.tests)) for mutant in mutants] if options.tests else mutants


def write(outcomes: Mapping[str, Outcome], path: Path | None) -> None:
    """Write the results so far."""
    if path is not None:
        results = json.dumps([asdict(outcome) for outcome in outcomes.values()], indent=1, ensure_ascii=False)
        path.write_text(results + "\n", encoding="utf-8")


def parsed() -> argparse.Namespace:
    """Return what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mutants", type=Path, metavar="MUTANTS.json")
    parser.add_argument("--tree", type=Path, default=Path(), help="the project's folder (default: this one)")
    parser.add_argument("--only", action="append", metavar="NAME", help="this mutant only (repeatable)")
    parser.add_argument("--tests", nargs="+", metavar="PATH", help="run these, in place of each mutant's own")
    parser.add_argument("--rest", action="store_true", help="run all tests where these pass")
    parser.add_argument("--every", action="store_true", help="count all tests that fail among the mutant's own")
    parser.add_argument("--limit", type=float, default=3600.0, help="seconds that one run of pytest may take")
    parser.add_argument("--list", action="store_true", help="run nothing: say what would be planted")
    parser.add_argument("-o", "--output", type=Path, help="write the results to this file, as JSON")
    arguments, pytest = split_at_dashes(sys.argv[1:])
    options = parser.parse_args(arguments)
    options.pytest = pytest
    return options


def split_at_dashes(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return what stands before ``--``, and what stands after it."""
    place = arguments.index("--") if "--" in arguments else len(arguments)
    return arguments[:place], arguments[place + 1 :]


def tried(mutant: Mutant, tests: Tests, *, every: bool) -> Outcome:
    """Return whether a mutant's own tests notice it; ``every``: count all that fail."""
    start_s = time.monotonic()
    with tests.copied(mutant) as copy:
        first = tests.first(copy, mutant.tests)
    outcome = Outcome(
        mutant.name, mutant.path, bool(first), mutant.tests, first, since(start_s), unsound=tuple(tests.unsound)
    )
    if not every or first == DID_NOT_END:
        return outcome
    start_s = time.monotonic()
    with tests.copied(mutant) as copy:
        found = tests.failing(copy, mutant.tests) if first else ()
    return replace(outcome, failing=tuple(found), failing_s=since(start_s))


def together(mutants: Sequence[Mutant], tests: Tests) -> Iterator[Outcome]:
    """Yield whether any test notices mutants that their own did not: all are planted at once.

    A test that one of them breaks might hide what another does in it; so each is tried alone on all tests that fail.
    Raises SystemExit: not all tests have run, so who is left has not survived them.
    """
    start_s = time.monotonic()
    with tests.copied(*mutants) as copy:
        found = tests.failing(copy, ALL)
    if DID_NOT_END in found:
        raise SystemExit(f"not all tests have run in {tests.limit_s:.0f} s; allow more (--limit)")
    for mutant in mutants:
        failing: list[str] = []
        if found:
            with tests.copied(mutant) as copy:
                failing = [test for test in tests.failing(copy, found) if tests.sound(test)]
        first = failing[0] if failing else ""
        yield Outcome(
            mutant.name, mutant.path, bool(first), ALL, first, since(start_s),
            failing=tuple(failing), unsound=tuple(tests.unsound),
        )  # fmt: skip


def since(start_s: float) -> float:
    """Return the seconds that have gone by, rounded."""
    return round(time.monotonic() - start_s, 1)


def shown(outcome: Outcome) -> str:
    """Return a line about a mutant."""
    what = f"caught by {outcome.first}" if outcome.caught else f"SURVIVED {' '.join(outcome.tests)}"
    count = "" if outcome.failing is None else f", {len(outcome.failing)} fail ({outcome.failing_s:.0f} s)"
    left_out = f", {len(outcome.unsound)} left out that fail anyway" if outcome.unsound else ""
    return f"{outcome.name}: {what} ({outcome.first_s:.0f} s{count}{left_out})"


if __name__ == "__main__":
    sys.exit(main())
