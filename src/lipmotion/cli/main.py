"""``lipmotion VERB ...``: errors in one line, and an exit code that says what kind."""

from __future__ import annotations

import argparse
import io
import logging
import os
import sys
from collections.abc import Sequence

from lipmotion.cli import animate, corpus, cues, evaluate, info, train
from lipmotion.errors import InputError, LipMotionError

VERBS = (animate, cues, corpus, train, evaluate, info)
EXIT_CODES = """exit codes: 0 done, 1 a bug, 2 wrong command line, 3 unusable input, 4 corpus, 5 alignment,
6 model file, 7 output, 8 missing package, 130 interrupted"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    logging.basicConfig(format="lipmotion: warning: %(message)s", level=logging.WARNING)
    try:
        _run(arguments)
    except LipMotionError as error:
        print(f"lipmotion: error: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("lipmotion: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has gone; nothing is left to say
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # what the operating system refuses: no permission, a name too long
        print(f"lipmotion: error: {error}", file=sys.stderr)
        return InputError.exit_code
    return 0


def _run(arguments: Sequence[str] | None) -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not know every letter of a file's name
    try:
        options = _parser().parse_args(arguments)
        options.run(options)
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()  # not when Python ends: nobody could be told then that it failed


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


if __name__ == "__main__":
    sys.exit(main())
