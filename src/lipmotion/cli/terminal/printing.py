"""Lines and JSON on standard output and standard error, which may be closed or have lost their reader.

Only this module writes to the standard streams: values become printable text, without terminal control characters.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from lipmotion.errors import ExportError
from lipmotion.printable import printable
from lipmotion.storage.json_text import as_json, replace_nan

LINE_START = "\r\x1b[K"  # terminal control characters that erase the rest of a progress bar


def print_line(text: object) -> None:
    """Print one line on standard output."""
    with _catch_failure():
        print(printable(text))


def print_lines(text: str) -> None:
    """Print lines on standard output, line ends and tabs kept; other control characters are escaped."""
    with _catch_failure():
        print("\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n")))


def write_bytes(path: Path) -> None:
    """Write the content of a file to standard output as it is. Raises ExportError: it cannot be written."""
    flush_output()
    with path.open("rb") as file, _catch_failure():
        shutil.copyfileobj(file, sys.stdout.buffer)
        sys.stdout.buffer.flush()


def print_error(text: object) -> None:
    """Print one line with the program's name on standard error, if standard error is open and takes it."""
    if sys.stderr is not None:
        print_usage(f"{LINE_START if sys.stderr.isatty() else ''}{with_program_name(text)}\n", is_wanted=False)


def print_usage(text: str, *, is_wanted: bool) -> None:
    """Print text of the program itself as it is: on standard output, where it was asked for; else on standard error."""
    if is_wanted:
        with _catch_failure():
            print(text, end="", flush=True)
    elif sys.stderr is not None:
        try:
            print(text, end="", file=sys.stderr, flush=True)
        except OSError:
            discard_pending(sys.stderr)  # nobody can be told


def with_program_name(text: object) -> str:
    """Return a text as one printable line that begins with the program's name."""
    return f"lipmotion: {printable(text)}"


def print_json(document: Any) -> None:
    """Print a JSON document as one line of ASCII on standard output. Raises ExportError: it cannot be written."""
    with _catch_failure():
        print(as_json(replace_nan(document)), flush=True)


def print_error_json(document: Any, *, spaced: bool = False) -> None:
    """Print a JSON document as one line of ASCII on standard error; ``spaced``: with a space within all braces.

    Raises ExportError: it cannot be written.
    """
    if sys.stderr is None:
        raise ExportError("standard error is closed; open it, or leave out what asks for messages there")
    try:
        print(_spaced(document) if spaced else as_json(replace_nan(document)), file=sys.stderr, flush=True)
    except OSError as error:
        discard_pending(sys.stderr)
        raise ExportError(f"standard error cannot be written: {error.strerror or error}") from error


def _spaced(document: Any) -> str:
    if not isinstance(document, dict):
        return as_json(document)
    return f"{{ {', '.join(f'{as_json(name)}: {_spaced(value)}' for name, value in document.items())} }}"


def flush_output() -> None:
    """Flush standard output now: when Python ends, a failure could not be reported. Raises ExportError: it failed."""
    with _catch_failure():
        if sys.stdout is not None:
            sys.stdout.flush()


@contextmanager
def _catch_failure() -> Iterator[None]:
    """Raise ExportError if standard output cannot be written; BrokenPipeError: its reader has gone."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise explain_output_error(error) from error


def discard_pending(stream: TextIO) -> None:
    """Discard buffered output of a stream, which Python would otherwise try to write again when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def explain_output_error(error: OSError) -> ExportError:
    """Discard pending output; return the error that says that standard output cannot be written."""
    discard_pending(sys.stdout)
    return ExportError(f"standard output cannot be written: {error.strerror or error}")
