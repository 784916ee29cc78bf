"""``lipmotion VERB ...``: errors in one line, and an exit code that says what kind."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from lipmotion.cli.stop import MESSAGE, Stopper


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    arguments : those of the process by default; the process is then taken to end with this call
    """
    stopper = Stopper()
    stopper.listen()
    try:
        return _guarded(arguments, stopper)
    except KeyboardInterrupt:
        _say(MESSAGE)
        return stopper.code or 130
    finally:
        stopper.leave(for_good=arguments is None)


def _guarded(arguments: Sequence[str] | None, stopper: Stopper) -> int:
    try:
        from lipmotion.cli import command_line

        command_line.run(arguments, stopper)
    except BrokenPipeError:  # the reader of our output has gone; nothing is left to say
        from lipmotion.cli.output import discard_output

        discard_output()
    except Exception as error:
        stopper.check()  # what was interrupted may fail in any way
        from lipmotion.cli.outcome import outcome

        known = outcome(error)
        if known is None:
            raise
        code, reason = known
        _say(f"error: {reason}")
        return code
    return 0


def _say(text: str) -> None:
    if sys.stderr is not None:
        line_start = "\r\x1b[K" if sys.stderr.isatty() else ""  # over what is left of a progress bar
        print(f"{line_start}lipmotion: {text}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
