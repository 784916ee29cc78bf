"""Running the programs of speech synthesisers within bounds: of time, of what they print, and of what they write."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from lipmotion.errors import InputError, MissingDependencyError

START_S, EACH_S = 30.0, 5.0
"""The time limit of a program: to start, and for each sentence; both are a hundred times what it needs."""
STILL_S = 10.0
"""A program that prints and writes nothing for so long hangs."""
POLL_S = 0.05
LARGEST_OUTPUT_BYTES = 4 << 20
"""Most bytes that a program may print: many times the phones of twenty sentences."""
LARGEST_SOUND_BYTES = 32 << 20
"""Most bytes that it may write for each sentence: many times the longest one (``units.text_normalisation``)."""
SHOWN_CHARACTERS = 200
"""Characters of a program's error message that ours repeats."""


def program_output(
    command: Sequence[str], package: str, sentences: int = 1, given: str = "", folder: Path | None = None
) -> str:
    """Return the standard output of a program. When it has ended, in whatever way, so have the programs it started.

    sentences : how many it synthesises, which sets its limits
    Raises MissingDependencyError: there is no such program. Raises InputError: it fails, takes too long, or prints or
    writes too much.
    """
    program = shutil.which(command[0])
    if program is None:
        raise MissingDependencyError(f"{command[0]} is not installed; install it: apt install {package}")
    name = package if command[0] == sys.executable else command[0]
    try:
        with tempfile.TemporaryFile() as task, tempfile.TemporaryFile() as printed, tempfile.TemporaryFile() as errors:
            task.write(given.encode())
            task.seek(0)
            with _started([program, *command[1:]], task, printed, errors) as process:
                _wait(process, name, sentences, lambda: (_size(printed) + _size(errors), _written(folder)))
            if process.returncode:
                errors.seek(0)
                message = (
                    " ".join(errors.read(4 * SHOWN_CHARACTERS).decode(errors="replace").split())[:SHOWN_CHARACTERS]
                    or "no message"
                )
                raise InputError(f"{name} failed with {process.returncode} ({message}); try another text or voice")
            printed.seek(0)
            return printed.read().decode().replace("\r\n", "\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{name} cannot be run ({error}); install it again: apt install {package}") from error


@contextmanager
def _started(
    command: Sequence[str], given: IO[bytes], printed: IO[bytes], errors: IO[bytes]
) -> Iterator[subprocess.Popen[bytes]]:
    """Give a program that runs in a group of its own; at the end it is killed, with all that it started."""
    process = subprocess.Popen(command, stdin=given, stdout=printed, stderr=errors, start_new_session=True)
    try:
        yield process
    finally:
        if sys.platform == "win32":
            process.kill()
        else:
            with suppress(OSError):  # all have ended
                os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _wait(process: subprocess.Popen[bytes], name: str, sentences: int, sizes: Callable[[], tuple[int, int]]) -> None:
    """Wait until a program has ended."""
    limit_s, largest = START_S + EACH_S * sentences, LARGEST_SOUND_BYTES * sentences
    start = moved = time.monotonic()
    before = 0, 0
    running = True
    while running:
        with suppress(subprocess.TimeoutExpired):
            process.wait(POLL_S)
            running = False
        now, sized = time.monotonic(), sizes()
        moved, before = (moved if sized == before else now), sized
        if sized[0] > LARGEST_OUTPUT_BYTES:
            raise InputError(f"{name} prints more than {LARGEST_OUTPUT_BYTES} bytes; try another text or voice")
        if sized[1] > largest:
            raise InputError(f"{name} writes more than {largest} bytes; try another text or voice")
        if running and (now - start > limit_s or now - moved > STILL_S):
            raise InputError(f"{name} did not end within {now - start:.0f} s; give shorter or fewer texts")


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _written(folder: Path | None) -> int:
    total = 0
    with suppress(OSError):  # the program removes what it wrote
        for path in folder.iterdir() if folder else ():
            total += path.lstat().st_size
    return total
