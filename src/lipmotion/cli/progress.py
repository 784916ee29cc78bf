"""Long work as a person follows it on a terminal, or as a program does (docs/long-work.md)."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from lipmotion.cli.events import Lines
from lipmotion.cli.output import complain, own, say_lines
from lipmotion.cli.stop import Stopper
from lipmotion.printable import printable
from lipmotion.types.progress import Item, Progress


class Report(Protocol):
    """Says how the work goes on."""

    def hear(self, event: Progress | Item) -> None:
        """Take one event from the work."""

    def warn(self, text: str) -> None:
        """Say what deserves attention."""

    def finish(self, text: str, **figures: Any) -> None:
        """Say what came of it: ``text`` to a person, ``figures`` to a program."""


@contextmanager
def reporting(options: argparse.Namespace) -> Iterator[Report]:
    """Give what the work reports to, while it lasts."""
    chosen = _Program(options.stopper, options.events) if options.machine_readable else _Terminal(options.stopper)
    report: Report = chosen
    logger = logging.getLogger("lipmotion")
    handler = _Warnings(report)
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield report
    finally:
        chosen.close()
        logger.removeHandler(handler)
        logger.propagate = True


class _Warnings(logging.Handler):
    def __init__(self, report: Report) -> None:
        super().__init__(logging.WARNING)
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        self._report.warn(record.getMessage())


class _Terminal:
    """A bar on standard error, if that is a terminal; warnings on it in any case; the result on standard output."""

    def __init__(self, stopper: Stopper) -> None:
        self._stopper = stopper
        self._shown = sys.stderr is not None and sys.stderr.isatty()
        self._bar: Any = None

    def hear(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._draw(event)
        elif event.reason:
            self.warn(f"{event.outcome} {event.name}: {event.reason}")

    def warn(self, text: str) -> None:
        text = f"warning: {text}"
        if self._bar is None:
            complain(text)
        else:
            self._bar.write(own(text), file=sys.stderr)

    def finish(self, text: str, **_: Any) -> None:
        self.close()
        self._stopper.settle()
        say_lines(text)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _draw(self, event: Progress) -> None:
        if not self._shown:
            return
        from tqdm import tqdm

        stage = printable(f"{event.stage} ({event.step}/{event.steps})")
        if self._bar is None:
            layout = "{desc} {percentage:3.0f}% |{bar:20}| {elapsed}, left {remaining}"
            self._bar = tqdm(total=1.0, initial=event.share, desc=stage, bar_format=layout, dynamic_ncols=True)
        self._bar.set_description_str(stage, refresh=False)
        self._bar.update(event.share - self._bar.n)
        self._bar.refresh()


class _Program:
    """Events for the program that runs this one."""

    def __init__(self, stopper: Stopper, events: Lines) -> None:
        self._stopper, self._events = stopper, events

    def hear(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._events.say(
                "progress", stage=event.stage, step=event.step, steps=event.steps, value=round(event.share, 4)
            )
        else:
            self._events.say("item", name=event.name, outcome=event.outcome, reason=event.reason)

    def warn(self, text: str) -> None:
        self._events.say("warning", message=text)

    def finish(self, text: str, **figures: Any) -> None:  # noqa: ARG002
        self._stopper.settle()
        self._events.succeed(**figures)

    def close(self) -> None:
        """Nothing is shown that would have to go."""
