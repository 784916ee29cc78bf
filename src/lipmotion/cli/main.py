"""``lipmotion VERB ...``: the entry point; an error is one line and an exit code of its kind."""

from __future__ import annotations

import gc
import os
import sys

from lipmotion.cli.terminal.events import MESSAGE, Events, Stopper, create_events

NEW_OBJECTS = 50_000
"""Unreachable cycles are searched after so many new objects: Python's 700 cost a twentieth of a short command."""
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    arguments : words of the command line; None: those of the process, which is then expected to end with this call
    """
    if arguments is None:
        for number in range(3):  # else a file of ours would take the number of a standard stream that is closed
            try:
                os.fstat(number)
            except OSError:
                os.open(os.devnull, os.O_RDWR)
        gc.set_threshold(NEW_OBJECTS)
    words = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None and sys.argv[0].replace("\\", "/").rpartition("/")[2].lower() in {"rhubarb", "rhubarb.exe"}:
        words = ["cues", "--datFrameRate", "24", *words]  # under this name programs that start Rhubarb find it
    stopper, events = Stopper(), create_events(words)
    try:
        try:
            stopper.listen()
            return _run(words, stopper, events)
        except KeyboardInterrupt:
            return _report_failure(events, stopper.code or 130, MESSAGE)
    finally:
        stopper.stop_listening(process_ends=arguments is None)


def _run(words: Sequence[str], stopper: Stopper, events: Events) -> int:
    try:
        from lipmotion.cli import command_line

        command_line.run(words, stopper, events)
    except BrokenPipeError:  # the reader of standard output has gone
        from lipmotion.cli.terminal.printing import discard_pending

        stopper.settle()
        discard_pending(sys.stdout)
    except (Exception, SystemExit) as error:  # of argparse: help, version, a wrong command line; or of an extension
        is_exit = isinstance(error, SystemExit)
        if not is_exit:
            stopper.check()  # interrupted work may fail in any way
        from lipmotion.cli.terminal.progress import describe_outcome

        known = describe_outcome(error)
        stopper.settle()
        if known is not None:
            return _report_failure(events, known[0], f"error: {known[1]}")
        if not is_exit:
            events.fail(f"{type(error).__name__}: {error}", 1)
            raise
        code = int(error.code or 0) if isinstance(error, SystemExit) else 0
        if code:
            events.fail("wrong command line", code)
        return code
    return 0


def _report_failure(events: Events, code: int, text: str) -> int:
    """Report an error as an event and as a line; return the exit code."""
    from lipmotion.cli.terminal.printing import print_error

    events.fail(text.removeprefix("error: "), code)
    if not events.replaces_errors:
        print_error(text)
    return code


if __name__ == "__main__":
    sys.exit(main())
