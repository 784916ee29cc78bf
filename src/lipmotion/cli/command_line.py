"""The arguments of a command, and the call that they ask for."""

from __future__ import annotations

import argparse
import errno
import io
import logging
import sys
from collections.abc import Sequence

from lipmotion.cli import adapt, animate, corpus, cues, evaluate, experiment, explain, info, train
from lipmotion.cli.output import refused
from lipmotion.cli.stop import Stopper

VERBS = (animate, explain, cues, corpus, train, adapt, evaluate, experiment, info)
EXIT_CODES = """exit codes: 0 done, 1 a bug, 2 wrong command line, 3 unusable input, 4 corpus, 5 alignment,
6 model file, 7 output, 8 missing package, 130 interrupted, 143 terminated"""


def run(arguments: Sequence[str] | None, stopper: Stopper) -> None:
    """Run one command. Raises whatever it raises; SystemExit: help was asked for, or the command line is wrong."""
    logging.basicConfig(format="lipmotion: warning: %(message)s", level=logging.WARNING)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not know every letter of a file's name
    try:
        options = _parser().parse_args(arguments, argparse.Namespace(stopper=stopper))
        options.run(options)
    except OSError as error:
        if error.errno == errno.ENOSPC and error.filename is None:
            raise refused(error) from error
        raise
    finally:
        if sys.stdout is not None:
            _flush()


def _flush() -> None:
    """Flush now, not when Python ends: nobody could be told then that it failed."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise refused(error) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lipmotion",
        description="Speech in, lip motion out, with models trained from your own recordings.",
        epilog=EXIT_CODES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    verbs = parser.add_subparsers(title="verbs", dest="verb", required=True, metavar="VERB")
    for verb in VERBS:
        verb.add(verbs)
    return parser


class _Version(argparse.Action):
    """Looks the version up only when it is wanted."""

    def __call__(self, *_: object) -> None:
        from importlib.metadata import version

        print(f"lipmotion {version('lipmotion')}")
        sys.exit(0)
