"""Paths on the command line: inputs and outputs, whose conflicts are refused early; and pipes: ``-``."""

from __future__ import annotations

import argparse
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from lipmotion.cli.terminal.progress import write_bytes
from lipmotion.storage.sources import Source, check_apart, is_folder


@dataclass(frozen=True)
class InputArgument:
    """An argument that names an input file or folder.

    name         : of the option in the namespace
    what         : noun for it in error messages
    replaceable  : read completely before anything is written, so that an output may replace it
    is_text      : may be a text instead of a path: a folder of that name is then not an input
    default_path : returns the input that is read where the argument is left out
    """

    name: str
    what: str
    replaceable: bool
    is_text: bool
    default_path: Callable[[], Path] | None


@dataclass(frozen=True)
class OutputArgument:
    """An argument that names an output file or folder.

    name       : of the option in the namespace
    is_folder  : whether it is a folder
    keeps_work : whether finished stages are kept in a folder beside it (``locks.unfinished_work``)
    """

    name: str
    is_folder: bool
    keeps_work: bool


def add_input(
    parser: argparse.ArgumentParser,
    *names: str,
    what: str,
    replaceable: bool = False,
    default_path: Callable[[], Path] | None = None,
    **more: Any,
) -> None:
    """Add an argument that names an input, with the further arguments of ``add_argument``."""
    action = parser.add_argument(*names, **({"type": _path_or_url if what == "corpus" else Path} | more))
    _declare(parser, "reads", InputArgument(action.dest, what, replaceable, action.type is str, default_path))


def _path_or_url(text: str) -> Path | str:
    return text if "://" in text else Path(text)


def add_output(
    parser: argparse.ArgumentParser,
    *names: str,
    is_folder: bool = False,
    keeps_work: bool = False,
    force: bool = False,
    **more: Any,
) -> None:
    """Add an argument that names an output, with the further arguments of ``add_argument``.

    force : also add the option ``--force``
    """
    action = parser.add_argument(*names, **({"type": Path} | more))
    _declare(parser, "writes", OutputArgument(action.dest, is_folder, keeps_work))
    if force:
        replacing = "let an output replace a text, units or model file that is read; never a recording or a corpus"
        parser.add_argument("--force", action="store_true", help=replacing)


def check_paths(options: argparse.Namespace) -> None:
    """Raise ExportError if an output of a command is one of its inputs."""
    from lipmotion.storage.locks import work_folder

    declared: tuple[OutputArgument, ...] = getattr(options, "writes", ())
    written = [(output, path) for output in declared for path in _paths(getattr(options, output.name))]
    if not written:
        return
    folders = [path for output, path in written if output.is_folder]
    folders += [work_folder(path) for output, path in written if output.keeps_work]
    files, sources = [path for output, path in written if not output.is_folder], list[Source]()
    for argument in getattr(options, "reads", ()):
        paths = _paths(getattr(options, argument.name))
        paths = paths or ([argument.default_path()] if argument.default_path else [])
        inputs = [path for path in paths if not (argument.is_text and is_folder(path))]
        sources += [Source(path, argument.what, argument.replaceable) for path in inputs]
    check_apart(files, sources, folders=folders, force=getattr(options, "force", False))


def _paths(value: Any) -> list[Path]:
    """Return the values of an argument as paths; none where it was left out."""
    given = value if isinstance(value, list | tuple) else [value]
    return [Path(text) for text in given if text is not None]


def _declare(parser: argparse.ArgumentParser, kind: str, argument: InputArgument | OutputArgument) -> None:
    """Append a declaration to the parser's default ``reads`` or ``writes``."""
    parser.set_defaults(**{kind: (*(parser.get_default(kind) or ()), argument)})


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
    from lipmotion.storage.locks import temporary_folder

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
    from lipmotion.storage.locks import temporary_folder

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
