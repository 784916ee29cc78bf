"""Standard input as a recording, and standard output as a motion file: ``-``."""

from __future__ import annotations

import argparse
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from lipmotion.cli.terminal.printing import write_bytes

PIPE = "-"
OPENED = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")
"""Where pipes are that the shell has opened for this process."""
LARGEST_RECORDING_BYTES = 1 << 32
"""Most bytes of a recording from a pipe."""
BLOCK = 1 << 20
FORMATS = ("json", "csv")


def add_pipe_format(parser: argparse.ArgumentParser) -> None:
    """Add ``--format``: of motion on standard output."""
    parser.add_argument("--format", choices=FORMATS, default="json", help="of '-o -', standard output (default: json)")


def is_pipe(path: Path | str) -> bool:
    """Return whether a path is ``-``, or a pipe that the shell has opened (``/dev/stdin``, ``<(...)``).

    Not a named pipe: nobody may ever write to it.
    """
    if str(path) == PIPE:
        return True
    if not str(path).startswith(OPENED):
        return False
    try:
        return stat.S_ISFIFO(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


@contextmanager
def read_pipe(path: Path) -> Iterator[Path]:
    """Yield the path of a recording; what comes through a pipe is stored in a temporary file.

    Raises InputError: nothing comes, or more than ``LARGEST_RECORDING_BYTES`` bytes.
    """
    if not is_pipe(path):
        yield path
        return
    from lipmotion.errors import InputError
    from lipmotion.storage.files import temporary_folder

    with temporary_folder() as folder:
        stored = folder / "standard-input"
        with stored.open("wb") as file:
            if str(path) == PIPE and sys.stdin is None:
                raise InputError("standard input is closed; required: a recording, as of 'ffmpeg ... -f wav -'")
            if str(path) == PIPE:
                _copy(sys.stdin.buffer, file)
            else:
                with path.open("rb") as source:
                    _copy(source, file)
        yield stored


@contextmanager
def write_pipe(options: argparse.Namespace) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Let ``-`` among the outputs be a temporary file, and write it to standard output at the end.

    Yields the outputs, and whether standard output is one of them; then nothing else may be printed there.
    """
    outputs = tuple(options.output)
    if PIPE not in outputs:
        yield outputs, False
        return
    from lipmotion.storage.files import temporary_folder

    with temporary_folder() as folder:
        motion = folder / f"motion.{options.format}"
        yield tuple(str(motion) if output == PIPE else output for output in outputs), True
        write_bytes(motion)


def _copy(source: IO[bytes], target: IO[bytes]) -> None:
    from lipmotion.errors import InputError

    size = 0
    while block := source.read(BLOCK):
        size += len(block)
        if size > LARGEST_RECORDING_BYTES:
            raise InputError(
                f"more than {LARGEST_RECORDING_BYTES} bytes come through the pipe; save the recording as a file first"
            )
        target.write(block)
    if not size:
        raise InputError("nothing comes through the pipe; required: a recording, as of 'ffmpeg ... -f wav -'")
