"""Progress and warnings of ``cues`` as JSON events, in the format of Rhubarb's ``--machineReadable``."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lipmotion.cli.terminal.events import RhubarbStatus


@contextmanager
def status_lines(options: argparse.Namespace) -> Iterator[Callable[[float], None]]:
    """Yield a function that reports progress, 0 to 1; report success at the end. Warnings become events, too."""
    events: RhubarbStatus = options.events
    root = logging.getLogger()
    handlers, root.handlers = root.handlers, [_StatusHandler(events)]
    try:
        yield lambda done: events.emit("progress", "Trace", f"Progress: {done:.0%}", value=done)
        options.stopper.settle()
        events.succeed()
    finally:
        root.handlers = handlers


class _StatusHandler(logging.Handler):
    def __init__(self, events: RhubarbStatus) -> None:
        super().__init__()
        self._events = events

    def emit(self, record: logging.LogRecord) -> None:
        self._events.emit("log", record.levelname.capitalize(), record.getMessage())
