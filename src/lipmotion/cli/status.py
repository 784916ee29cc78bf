"""Status lines for programs that run this one: JSON on standard error, as Rhubarb Lip Sync's ``--machineReadable``."""

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
    """Say that the work starts, and how it ended; give a function that says how much is done, from 0 to 1.

    A failure is said as such, and the program ends with its exit code. Warnings become events ``log``.
    """
    root, warnings = logging.getLogger(), _Warnings()
    handlers, root.handlers = root.handlers, [warnings]
    name = as_text(speech)
    try:
        _say("start", "Info", f'Application startup. Input file: "{name}".', file=name)
        yield lambda done: _say("progress", "Trace", f"Progress: {done:.0%}", value=done)
        _say("success", "Info", "Application terminating normally.")
    except BrokenPipeError:  # nobody is there to be told
        raise
    except (LipMotionError, OSError) as error:
        _say(
            "failure", "Fatal", f"Application terminating with error: {as_text(str(error))}", reason=as_text(str(error))
        )
        sys.exit(error.exit_code if isinstance(error, LipMotionError) else InputError.exit_code)
    finally:
        root.handlers = handlers


class _Warnings(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        _say("log", record.levelname.capitalize(), record.getMessage())


def _say(kind: str, level: str, message: str, **data: object) -> None:
    print(json.dumps({"type": kind, **data, "log": {"level": level, "message": message}}), file=sys.stderr, flush=True)
