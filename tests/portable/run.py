"""``python -m portable.run``: run tests as on other processors, or as on Windows (``make test-portable``)."""

import argparse
import itertools
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from children import run_child
from portable.settings import BEFORE_AVX, CORES, different_cores, environment, kernels, possible_cores

TESTS = Path(__file__).parents[1]
NUMERIC = (
    *("stats", "hmm", "kernels/test_compiler.py", "engines/trajectory/test_engine.py", "pipeline/test_animate.py"),
    *(f"motion/test_{name}.py" for name in ("predictors", "limits", "speaker_maps")),
    *(f"speech/test_{name}.py" for name in ("f0", "mfcc", "recogniser", "analysed_audio")),
    *("speech/general", "pipeline/training/test_resume.py"),
)
"""Tests that notice rounding: they compare what was computed in two ways, choose between values that nearly tie, or
need the same bytes twice; name others on the command line for more."""
WRITING = [str(TESTS / folder) for folder in ("storage", "pipeline/batch", "studio/test_folder.py")]
"""Tests that notice the files, folders and locks of another system."""
LIKE_WINDOWS = {"PYTHONPATH": os.pathsep.join((str(TESTS.parent / "scripts" / "like_windows"), str(TESTS)))}
LONGEST_S = 3600.0
LEFT_OUT = ["-m", "not long and not video", "-k", "not memory"]
"""Tests that take longer and compute nothing that the others do not."""


class Outcome(NamedTuple):
    """The outcome of the tests under one setting."""

    name: str
    passed: bool
    seconds: float
    last_line: str


def settings() -> dict[str, dict[str, str]]:
    """Return the variables of every setting by its name: each kind of kernels, in turn with one thread and with two.

    No processor has the oldest kernels beside AVX in NumPy: they are run without it.
    """
    found = {
        f"{core}, {threads} thread{'s' * (threads > 1)}": {
            "OPENBLAS_CORETYPE": core,
            "OPENBLAS_NUM_THREADS": str(threads),
        }
        for core, threads in zip(different_cores(), itertools.cycle((1, 2)))
        if core != BEFORE_AVX["OPENBLAS_CORETYPE"]
    }
    return found | {"no AVX, in NumPy neither": BEFORE_AVX}


def tested(name: str, changes: dict[str, str], tests: Sequence[str]) -> Outcome:
    """Return the outcome of the tests in a process with changed environment variables."""
    began = time.monotonic()
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *LEFT_OUT, *tests]
    ran = run_child(command, variables=environment(changes), folder=TESTS.parent, limit_s=LONGEST_S)
    if ran.returncode:
        print(f"--- {name}\n{ran.stdout[-20_000:]}{ran.stderr[-5000:]}", flush=True)
    lines = [line for line in ran.stdout.splitlines() if line.strip()]
    return Outcome(name, ran.returncode == 0, time.monotonic() - began, lines[-1] if lines else "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for every setting; return 1 where a test failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tests", nargs="*", default=[str(TESTS / folder) for folder in NUMERIC])
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args(arguments)
    for core in CORES:
        able = core in possible_cores()
        print(f"{core}: {kernels(core) if able else 'left out: this processor lacks its instructions'}", flush=True)
    with ThreadPoolExecutor(options.jobs) as pool:
        jobs = [pool.submit(tested, name, changes, options.tests) for name, changes in settings().items()]
        if sys.platform == "linux" and options.tests == parser.get_default("tests"):
            jobs.append(pool.submit(tested, "as on Windows", LIKE_WINDOWS, WRITING))
        outcomes = [job.result() for job in jobs]
    for outcome in outcomes:
        verdict = "passed" if outcome.passed else "FAILED"
        print(f"{verdict}  {outcome.name:<28} {outcome.seconds:5.0f} s  {outcome.last_line}")
    print(f"{sum(o.passed for o in outcomes)} passed, {sum(not o.passed for o in outcomes)} failed")
    return 0 if all(outcome.passed for outcome in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
