"""Ctrl-C and ``kill``: one line, no traceback, and nothing half written left behind.

This module is loaded before all others, and loads none that takes time.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from types import FrameType

MESSAGE = "stopped; run the same command again to go on"
IMPATIENT_S = 1.0
"""A second signal ends the program at once; within this time it is taken for the same one, sent on by a launcher."""


def _print_nothing(*_: object) -> None: ...


class Stopped(KeyboardInterrupt):
    """A signal came. (Python ends as if killed by Ctrl-C where it saw a bare KeyboardInterrupt leave an ``exec``.)"""


class Stopper:
    """Turns the signals into KeyboardInterrupt, so that every ``finally`` on the way out tidies up.

    An exception that is raised in the middle of an import, or in a callback, may be swallowed or become another one:
    so ``code`` says afterwards whether there was a signal, and ``check`` raises again at the next step of the work.
    Once the outcome is settled a signal comes too late: what is to be said of it is said, and its exit code returned.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        self._settled = False
        self._since_s: float | None = None
        self._hooks = sys.excepthook, sys.unraisablehook
        self._before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def listen(self) -> None:
        """Begin, if this is the main thread; a signal that is ignored (``nohup``) stays so."""
        if threading.current_thread() is threading.main_thread():
            for number, before in self._before.items():
                if before is not signal.SIG_IGN:
                    signal.signal(number, self._stop)

    def leave(self, *, for_good: bool) -> None:
        """End; ``for_good``: the process is over, and a signal would only spoil its exit code."""
        if not for_good:
            sys.excepthook, sys.unraisablehook = self._hooks
        if threading.current_thread() is threading.main_thread():
            for number, before in self._before.items():
                if before is not None and before is not signal.SIG_IGN:
                    signal.signal(number, signal.SIG_IGN if for_good else before)

    def check(self) -> None:
        """Raise Stopped if there was a signal."""
        if self.code is not None:
            raise Stopped

    def settle(self) -> None:
        """Let the outcome be what it is now. Raises Stopped if there was a signal before."""
        if not self._settled:
            self.check()
            self._settled = True

    def _stop(self, number: int, _: FrameType | None) -> None:
        now_s = time.monotonic()
        if self._since_s is not None:
            if now_s - self._since_s > IMPATIENT_S:
                os._exit(self.code or 128 + number)
            return
        self._since_s = now_s
        if not self._settled:
            self.code = 128 + number
            sys.excepthook = _print_nothing  # what swallows an exception may also print it
            sys.unraisablehook = _print_nothing
            raise Stopped
