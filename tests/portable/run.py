"""``python -m portable.run``: run tests as on other processors, or as on Windows (``make test-portable``)."""

import argparse
import itertools
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

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


def settings() -> dict[str, dict[str, str]]:
    """Return the variables of every setting by its name: each kind of kernels, in turn with two threads and with one.

    With this processor's own kernels ``make test`` runs the tests. No processor has the oldest kernels beside AVX in
    NumPy: they are run without it.
    """
    found = {
        f"{core}, {threads} thread{'s' * (threads > 1)}": {
            "OPENBLAS_CORETYPE": core,
            "OPENBLAS_NUM_THREADS": str(threads),
        }
        for core, threads in zip(different_cores(), itertools.cycle((2, 1)))
        if core != BEFORE_AVX["OPENBLAS_CORETYPE"]
    }
    return found | {"no AVX, in NumPy neither": BEFORE_AVX}


def tested(name: str, changes: dict[str, str], tests: Sequence[str]) -> bool:
    """Run the tests in a process with changed environment variables, and print how they ended; return if all passed."""
    began = time.monotonic()
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *LEFT_OUT, *tests]
    ran = run_child(command, variables=environment(changes), folder=TESTS.parent, limit_s=LONGEST_S)
    if ran.returncode:
        print(f"--- {name}\n{ran.stdout[-20_000:]}{ran.stderr[-5000:]}", flush=True)
    last_line = ran.stdout.rstrip().rpartition("\n")[2]
    verdict = "FAILED" if ran.returncode else "passed"
    print(f"{verdict}  {name:<28} {time.monotonic() - began:5.0f} s  {last_line}", flush=True)
    return not ran.returncode


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
    print(f"{sum(outcomes)} passed, {len(outcomes) - sum(outcomes)} failed")
    return 0 if all(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
