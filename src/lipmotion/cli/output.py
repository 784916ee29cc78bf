"""Printing: values from files and from the command line become printable text, without terminal control characters.

Only this module writes to the standard streams.
"""

from __future__ import annotations

import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from lipmotion.errors import ExportError
from lipmotion.printable import printable
from lipmotion.storage.json_text import as_json, nan_as_null

LINE_START = "\r\x1b[K"
"""Terminal control characters that erase the rest of a progress bar."""


def print_line(text: object) -> None:
    """Print one line on standard output."""
    print(printable(text))


def print_lines(text: str) -> None:
    """Print lines on standard output, line ends and tabs kept; other control characters are escaped."""
    print("\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n")))


def write_bytes(path: Path) -> None:
    """Write the content of a file to standard output as it is. Raises ExportError: it cannot be written."""
    flush_output()
    try:
        with path.open("rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise output_error(error) from error


def print_error(text: object) -> None:
    """Print one line with the program's name on standard error, if standard error is open."""
    with suppress(OSError):
        if sys.stderr is not None:
            print(f"{LINE_START if sys.stderr.isatty() else ''}{with_program_name(text)}", file=sys.stderr)


def print_note(text: object) -> None:
    """Print one line for people on standard error, if it is a terminal: programs find the same in files.

    An empty text is not printed.
    """
    if text and sys.stderr is not None and sys.stderr.isatty():
        print_error(text)


def with_program_name(text: object) -> str:
    """Return a text as one printable line that begins with the program's name."""
    return f"lipmotion: {printable(text)}"


def print_json(document: Any) -> None:
    """Print a JSON document as one line of ASCII on standard output."""
    print(as_json(nan_as_null(document)), flush=True)


def print_error_json(document: Any) -> None:
    """Print a JSON document as one line of ASCII on standard error."""
    print(as_json(nan_as_null(document)), file=sys.stderr, flush=True)


def flush_output() -> None:
    """Flush standard output now: when Python ends, a failure could not be reported. Raises ExportError: it failed."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise output_error(error) from error


def discard_pending_output() -> None:
    """Discard buffered output, which Python would otherwise try to write again when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def output_error(error: OSError) -> ExportError:
    """Discard pending output; return the error that says that standard output cannot be written."""
    discard_pending_output()
    return ExportError(f"standard output cannot be written: {error.strerror or error}")
