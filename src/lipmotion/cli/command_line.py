"""The parser of the command line, and the execution of one command."""

from __future__ import annotations

import argparse
import errno
import io
import logging
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn

from lipmotion.cli import (
    adapt,
    animate,
    batch,
    character,
    cite,
    corpus,
    cues,
    evaluate,
    experiment,
    explain,
    face,
    info,
    speak,
    train,
    words,
)
from lipmotion.cli.events import Events
from lipmotion.cli.output import flush_output, output_error, print_line, with_program_name
from lipmotion.cli.paths import check_paths
from lipmotion.cli.stop import Stopper
from lipmotion.printable import printable

VERBS = (
    animate,
    batch,
    speak,
    explain,
    cues,
    words,
    corpus,
    train,
    adapt,
    face,
    character,
    evaluate,
    experiment,
    info,
    cite,
)
EXIT_CODES = """exit codes: 0 done, 1 a bug, 2 wrong command line, 3 unusable input, 4 corpus, 5 alignment,
6 model file, 7 output, 8 missing package, 130 interrupted, 143 terminated"""


def run(arguments: Sequence[str] | None, stopper: Stopper, events: Events) -> None:
    """Parse and run one command.

    arguments : words of the command line without the program's name; None: those of the process
    Raises whatever the command raises; SystemExit: help was asked for, or the command line is wrong.
    """
    _log_warnings_as_lines()
    show_before, warnings.showwarning = warnings.showwarning, _log_warning
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not know every letter of a file's name
    try:
        options = parser().parse_args(arguments, argparse.Namespace(stopper=stopper, events=events))
        events.start(options)
        check_paths(options)
        options.run(options)
        stopper.settle()
    except OSError as error:
        if error.errno == errno.ENOSPC and error.filename is None:
            raise output_error(error) from error
        raise
    finally:
        warnings.showwarning = show_before
        flush_output()


def parser() -> argparse.ArgumentParser:
    """Return the parser with all verbs."""
    whole = _Parser(
        prog="lipmotion",
        description="Speech in, lip motion out, with models trained from your own recordings.",
        epilog=EXIT_CODES,
    )
    whole.add_argument("--version", action=_Version, nargs=0, help="print the version")
    verbs = whole.add_subparsers(title="verbs", dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        verb.add(verbs)
    return whole


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line as printable text."""

    def error(self, message: str) -> NoReturn:
        super().error(printable(message))


class _Version(argparse.Action):
    """Prints the version, which is looked up only when the option is given."""

    def __call__(self, *_: object) -> None:
        from importlib.metadata import version

        print_line(f"lipmotion {version('lipmotion')}")
        sys.exit(0)


class _WarningFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return with_program_name(f"warning: {record.getMessage()}")


def _log_warning(message: object, *_: object, **__: object) -> None:
    """Log a warning of Python or of another package, so that it is printed as one printable line."""
    logging.getLogger("py.warnings").warning("%s", message)


def _log_warnings_as_lines() -> None:
    """Print each logged warning as one line on standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(_WarningFormatter())
    logging.basicConfig(handlers=[handler], level=logging.WARNING)
