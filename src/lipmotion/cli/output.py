"""All that is printed: values of files and of the command line as printable text, never as what a terminal obeys.

Only this module writes to the standard streams.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import Any

from lipmotion.errors import ExportError
from lipmotion.printable import printable
from lipmotion.storage.json_text import as_json, defined

LINE_START = "\r\x1b[K"
"""Over what is left of a progress bar, on a terminal."""


def say(text: object) -> None:
    """Print one line on standard output."""
    print(printable(text))


def say_lines(text: str) -> None:
    """Print lines on standard output as they are laid out, with line ends and tabs; the values in them are one line."""
    print("\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n")))


def complain(text: object) -> None:
    """Print one line of this program's own on standard error, if there is one that takes it."""
    with suppress(OSError):
        if sys.stderr is not None:
            print(f"{LINE_START if sys.stderr.isatty() else ''}{own(text)}", file=sys.stderr)


def own(text: object) -> str:
    """Return a line that says who speaks."""
    return f"lipmotion: {printable(text)}"


def say_json(document: Any) -> None:
    """Print a document on one line of standard output, in ASCII."""
    print(as_json(defined(document)), flush=True)


def complain_json(document: Any) -> None:
    """Print a document on one line of standard error, in ASCII."""
    print(as_json(defined(document)), file=sys.stderr, flush=True)


def flush_output() -> None:
    """Flush now, not when Python ends: nobody could be told then that it failed. Raises ExportError: as ``refused``."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise refused(error) from error


def discard_output() -> None:
    """Throw away what is still to be written: Python tries again when it ends, and nobody could be told then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def refused(error: OSError) -> ExportError:
    """Return the error that says that standard output takes no more, and discard the rest."""
    discard_output()
    return ExportError(f"standard output cannot be written: {error.strerror or error}")
