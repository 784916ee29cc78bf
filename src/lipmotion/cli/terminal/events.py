"""Signals, after which one line is printed and no unfinished file is left; and events of ``--machine-readable``.

Events are JSON objects for the calling program; the last one says how the command ended.

This module is loaded before signals are handled, so it imports nothing that takes time.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType

MESSAGE = "stopped; run the same command again to go on"
SAME_SIGNAL_S = 1.0
"""A second signal ends the program at once; within this time it counts as the first one, sent again by a launcher."""


class Stopped(KeyboardInterrupt):
    """A signal was received.

    A class of its own: where a bare KeyboardInterrupt leaves an ``exec``, Python ends as if killed by Ctrl-C.
    """


class Stopper:
    """Turns SIGINT and SIGTERM into KeyboardInterrupt, so that every ``finally`` cleans up.

    An exception that is raised during an import, or in a callback, may be swallowed or turned into another one:
    so ``code`` holds the exit code of a received signal, and ``check`` raises again at the next step of the work.
    After ``settle`` the outcome is final: a later signal changes neither the report nor the exit code.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        self._settled = False
        self._since_s: float | None = None
        self._hooks = sys.excepthook, sys.unraisablehook
        self._before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def listen(self) -> None:
        """Install the handlers, if this is the main thread; an ignored signal (``nohup``) stays ignored."""
        if threading.current_thread() is threading.main_thread():
            for number, before in self._before.items():
                if before is not signal.SIG_IGN:
                    signal.signal(number, self._stop)

    def stop_listening(self, *, process_ends: bool) -> None:
        """Restore the handlers; ``process_ends``: ignore signals instead, which would change the exit code."""
        if not process_ends:
            sys.excepthook, sys.unraisablehook = self._hooks
        if threading.current_thread() is threading.main_thread():
            for number, before in self._before.items():
                if before is not None and before is not signal.SIG_IGN:
                    signal.signal(number, signal.SIG_IGN if process_ends else before)

    def check(self) -> None:
        """Raise Stopped if a signal was received."""
        if self.code is not None:
            raise Stopped

    def settle(self) -> None:
        """Make the outcome final. Raises Stopped if a signal was received before."""
        if not self._settled:
            self.check()
            self._settled = True

    def _stop(self, number: int, _: FrameType | None) -> None:
        now_s = time.monotonic()
        if self._since_s is not None:
            if now_s - self._since_s > SAME_SIGNAL_S:
                os._exit(self.code or 128 + number)
            return
        self._since_s = now_s
        if not self._settled:
            self.code = 128 + number
            sys.excepthook = lambda *_: None  # code that swallows an exception may print it
            sys.unraisablehook = lambda _: None
            raise Stopped


TYPE_CHECKING = False
if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence
    from typing import Any

OPTIONS = ("--machine-readable", "--machineReadable")
STANDARD_OUTPUT = "-"


class Events:
    """No events, and the interface of the classes below.

    replaces_errors : whether the events take the place of error lines on standard error
    """

    replaces_errors = False
    _ended = False

    def start(self, options: Namespace) -> None:
        """Report that the command starts."""

    def fail(self, reason: str, code: int) -> None:
        """Report why the command failed, unless its end has been reported already."""


class JsonLines(Events):
    """One JSON object per line on standard output (docs/long-work.md), or on standard error if ``-`` is an output."""

    _on_error = False

    def start(self, options: Namespace) -> None:  # noqa: D102
        outputs = getattr(options, "output", None)
        self._on_error = isinstance(outputs, list | tuple) and STANDARD_OUTPUT in outputs
        self.emit("start")

    def emit(self, kind: str, /, **fields: Any) -> None:
        """Write one event; nothing after the last one. Raises ExportError: standard output cannot be written."""
        if self._ended:
            return
        from lipmotion.cli.terminal.printing import explain_output_error, print_error_json, print_json
        from lipmotion.errors import ExportError

        try:
            (print_error_json if self._on_error else print_json)({"type": kind, **fields})
        except ExportError:  # a full disk: nobody would receive the result
            self._ended = True
            raise
        except BrokenPipeError as error:  # nor if the reader has gone
            self._ended = True
            raise explain_output_error(error) from error

    def succeed(self, **figures: Any) -> None:
        """Report success with the figures of the result."""
        self.emit("success", **figures)
        self._ended = True

    def fail(self, reason: str, code: int) -> None:  # noqa: D102
        from lipmotion.errors import ExportError

        with suppress(ExportError):
            self.emit("failure", reason=reason, exit_code=code)
        self._ended = True


class RhubarbStatus(Events):
    """One JSON object per line on standard error, and nothing else there: as Rhubarb's ``--machineReadable``.

    Also its spaces: OpenToonz cuts two characters off both ends of a line, and divides the rest at commas.
    """

    replaces_errors = True

    def start(self, options: Namespace) -> None:  # noqa: D102
        from lipmotion.storage.files import as_text

        name = as_text(options.speech)
        self.emit("start", "Info", f"Application startup. Input file: {name}.", file=name)

    def emit(self, kind: str, level: str, message: str, **data: Any) -> None:
        """Write one event; nothing after the last one."""
        if not self._ended:
            from lipmotion.cli.terminal.printing import print_error_json

            print_error_json({"type": kind, **data, "log": {"level": level, "message": message}}, spaced=True)

    def succeed(self) -> None:
        """Report success."""
        self.emit("success", "Info", "Application terminating normally.")
        self._ended = True

    def fail(self, reason: str, code: int) -> None:  # noqa: D102, ARG002
        from lipmotion.errors import ExportError

        with suppress(ExportError):  # nobody reads standard error
            self.emit("failure", "Fatal", f"Application terminating with error: {reason}", reason=reason)
        self._ended = True


def create_events(words: Sequence[str]) -> Events:
    """Return the events that a command line asks for, before it is parsed: parsing errors are events, too."""
    requested = any(len(word) > 2 and option.startswith(word) for option in OPTIONS for word in words)
    verb = next((word for word in words if not word.startswith("-")), "")
    if not requested:
        return Events()
    return RhubarbStatus() if verb == "cues" else JsonLines()
