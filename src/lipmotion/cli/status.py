"""Status for programs that run this one: JSON lines on standard error, those of Rhubarb's ``--machineReadable``."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lipmotion.errors import InputError, LipMotionError
from lipmotion.files import as_text


@contextmanager
def status_lines(speech: Path) -> Iterator[Callable[[float], None]]:
    """Say that work starts and how it ended; give a function to say how much is done, 0 to 1. Warnings are events, too.

    A failure is said as such, and the program ends with its exit code.
    """
    root, name = logging.getLogger(), as_text(speech)
    handlers, root.handlers = root.handlers, [_Events()]
    try:
        _say("start", "Info", f'Application startup. Input file: "{name}".', file=name)
        yield lambda done: _say("progress", "Trace", f"Progress: {done:.0%}", value=done)
        _say("success", "Info", "Application terminating normally.")
    except (LipMotionError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # nobody is there to be told
            raise
        reason = as_text(str(error))
        _say("failure", "Fatal", f"Application terminating with error: {reason}", reason=reason)
        sys.exit(getattr(error, "exit_code", InputError.exit_code))
    finally:
        root.handlers = handlers


class _Events(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        _say("log", record.levelname.capitalize(), record.getMessage())


def _say(kind: str, level: str, message: str, **data: object) -> None:
    print(json.dumps({"type": kind, **data, "log": {"level": level, "message": message}}), file=sys.stderr, flush=True)
