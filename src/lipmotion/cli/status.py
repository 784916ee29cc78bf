"""Status for programs that run ``cues``: progress and warnings as events, those of Rhubarb's ``--machineReadable``."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lipmotion.cli.events import Status


@contextmanager
def status_lines(options: argparse.Namespace) -> Iterator[Callable[[float], None]]:
    """Give a function to say how much is done, 0 to 1; say that all is, at the end. Warnings are events, too."""
    events: Status = options.events
    root = logging.getLogger()
    handlers, root.handlers = root.handlers, [_Events(events)]
    try:
        yield lambda done: events.say("progress", "Trace", f"Progress: {done:.0%}", value=done)
        options.stopper.settle()
        events.succeed()
    finally:
        root.handlers = handlers


class _Events(logging.Handler):
    def __init__(self, events: Status) -> None:
        super().__init__()
        self._events = events

    def emit(self, record: logging.LogRecord) -> None:
        self._events.say("log", record.levelname.capitalize(), record.getMessage())
