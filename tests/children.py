"""Processes that tests start: alike whatever the tests run under, limited in time, and none outlives its test.

Every test starts processes here and nowhere else (``architecture/test_code.py``): ``run_child`` waits for the end of
one, ``child`` gives one that is at work, ``wait_until`` waits for what another process does. A process begins with the
signals as a terminal leaves them (``nohup`` and background jobs ignore some, and children inherit that), without a
terminal, without the settings of the shell, and as the leader of a process group, which is killed at the end of the
block, or after ``limit_s``; an alarm ends it where the tests themselves are killed.
"""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

LIPMOTION = (sys.executable, "-m", "lipmotion.cli.main")
FEW_STEPS = "from lipmotion.motion import posterior_network as n; n.STEPS = n.RECURRENT_STEPS = 4.0"
HASTY = (sys.executable, "-c", f"{FEW_STEPS}\nfrom lipmotion.cli.main import main\nraise SystemExit(main())")
"""The command line, whose networks are trained for a few steps: where it counts that training runs, not how well."""
LIMIT_S = 600.0  # a test that hangs fails after this time; none takes a tenth of it, however much else the machine does
ORPHANED_S = 30  # how long a process may go on after its limit where nobody is left who kills it
PIPE, NOWHERE, TO_STDOUT = subprocess.PIPE, subprocess.DEVNULL, subprocess.STDOUT
Child = subprocess.Popen[str]
Done = subprocess.CompletedProcess[str]
Stream = int | IO[str] | IO[bytes] | None

SETTINGS = ("PYTHON", "LIPMOTION_", "LC_", "LANG", "COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TQDM_", "PYTEST_")
KEPT = ("PYTHONPATH", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE")
LAUNCHER = """
import os, signal, sys
for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
    signal.signal(number, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_SETMASK, ())
signal.alarm(int(sys.argv[1]))
os.execvp(sys.argv[2], sys.argv[2:])
"""


def environment(**changes: str) -> dict[str, str]:
    """Return the environment of a process: this one's without the settings of a shell, with changes."""
    own = {name: value for name, value in os.environ.items() if name in KEPT or not name.startswith(SETTINGS)}
    return own | {"LC_ALL": "C.UTF-8"} | changes


@contextmanager
def child(
    command: Sequence[object],
    *,
    folder: Path | None = None,
    variables: dict[str, str] | None = None,
    stdin: Stream = NOWHERE,
    stdout: Stream = PIPE,
    stderr: Stream = None,
    limit_s: float = LIMIT_S,
) -> Iterator[Child]:
    """Give a process that is at work; kill it and all that it started at the end of the block, or after ``limit_s``.

    command   : its words; paths and numbers are made words
    variables : its whole environment; None: ``environment()``
    stderr    : None: that of the tests, which pytest shows where a test fails
    Wait for its end inside the block where its exit code matters. Raises AssertionError: it was ended by ``limit_s``.
    """
    words = [str(word) for word in command]
    if os.name == "posix":
        words = [sys.executable, "-I", "-S", "-c", LAUNCHER, str(math.ceil(limit_s) + ORPHANED_S), *words]
    with subprocess.Popen(
        words,
        cwd=folder,
        env=environment() if variables is None else variables,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        encoding="utf-8",
        errors="backslashreplace",
        start_new_session=True,
    ) as process:
        clock = threading.Timer(limit_s, _kill, [process])
        clock.daemon = True
        clock.start()
        try:
            yield process
        finally:
            is_late = clock.finished.is_set()
            clock.cancel()
            _kill(process)
            assert not is_late, f"still at work after {limit_s} s: {command}"


def run_child(
    command: Sequence[object],
    *,
    text: str = "",
    folder: Path | None = None,
    variables: dict[str, str] | None = None,
    stdout: Stream = PIPE,
    stderr: Stream = PIPE,
    limit_s: float = LIMIT_S,
    check: bool = False,
) -> Done:
    """Return what a process printed, and its exit code, once it and all that prints for it have ended.

    text  : what it reads on standard input
    check : whether any exit code but 0 is an AssertionError that shows what was printed
    """
    with child(
        command, folder=folder, variables=variables, stdin=PIPE, stdout=stdout, stderr=stderr, limit_s=limit_s
    ) as process:
        out, err = process.communicate(text)
    done = Done([str(word) for word in command], process.returncode, out, err)
    assert not check or done.returncode == 0, done
    return done


def wait_until(holds: Callable[[], object], limit_s: float = LIMIT_S) -> None:
    """Return as soon as a condition holds. Raises AssertionError: it does not within ``limit_s``."""
    ends_s = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < ends_s, f"not so within {limit_s} s"
        time.sleep(0.02)


def _kill(process: Child) -> None:
    """End a process and its group, as far as they are still there."""
    with suppress(ProcessLookupError, PermissionError):
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
