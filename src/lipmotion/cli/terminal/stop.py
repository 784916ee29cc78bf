"""Signals: after Ctrl-C or ``kill`` the program prints one line and leaves no unfinished file.

This module is imported before all others, so it imports nothing that takes time.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from types import FrameType

MESSAGE = "stopped; run the same command again to go on"
SAME_SIGNAL_S = 1.0
"""A second signal ends the program at once; within this time it counts as the first one, sent again by a launcher."""


def _print_nothing(*_: object) -> None: ...


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
            sys.excepthook = _print_nothing  # code that swallows an exception may print it
            sys.unraisablehook = _print_nothing
            raise Stopped
