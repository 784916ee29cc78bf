"""``lipmotion VERB ...``: errors in one line, and an exit code that says what kind."""

from __future__ import annotations

import sys

from lipmotion.cli.events import Events, events_of
from lipmotion.cli.stop import MESSAGE, Stopper

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    arguments : those of the process by default; the process is then taken to end with this call
    """
    stopper, events = Stopper(), events_of(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            stopper.listen()
            return _run(arguments, stopper, events)
        except KeyboardInterrupt:
            return _told(events, stopper.code or 130, MESSAGE)
    finally:
        stopper.leave(for_good=arguments is None)


def _run(arguments: Sequence[str] | None, stopper: Stopper, events: Events) -> int:
    try:
        from lipmotion.cli import command_line

        command_line.run(arguments, stopper, events)
    except BrokenPipeError:  # the reader of our output has gone; nothing is left to say
        from lipmotion.cli.output import discard_output

        stopper.settle()
        discard_output()
    except Exception as error:
        stopper.check()  # what was interrupted may fail in any way
        from lipmotion.cli.outcome import outcome

        known = outcome(error)
        stopper.settle()
        if known is None:
            events.fail(f"{type(error).__name__}: {error}", 1)
            raise
        code, reason = known
        return _told(events, code, f"error: {reason}")
    except SystemExit as end:  # argparse: help, version, a wrong command line
        stopper.settle()
        code = int(end.code or 0)
        if code:
            events.fail("wrong command line", code)
        return code
    return 0


def _told(events: Events, code: int, text: str) -> int:
    from lipmotion.cli.output import complain

    events.fail(text.removeprefix("error: "), code)
    if not events.alone:
        complain(text)
    return code


if __name__ == "__main__":
    sys.exit(main())
