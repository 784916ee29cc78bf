"""Progress of long work, shown on a terminal or written as events for a program (docs/long-work.md)."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from lipmotion.cli.terminal.events import JsonLines
from lipmotion.cli.terminal.printing import print_error, print_lines, with_program_name
from lipmotion.cli.terminal.stop import Stopper
from lipmotion.printable import printable
from lipmotion.types.progress import Item, Progress


class Report(Protocol):
    """Receives the events of long work."""

    def receive(self, event: Progress | Item) -> None:
        """Show or write one event."""

    def warn(self, text: str) -> None:
        """Show or write a warning."""

    def finish(self, text: str, **figures: Any) -> None:
        """Give the result: ``text`` for a person, ``figures`` for a program."""


@contextmanager
def report_progress(options: argparse.Namespace) -> Iterator[Report]:
    """Yield the report of a command; meanwhile the package's warnings go to it, too."""
    chosen = (
        _MachineReport(options.stopper, options.events)
        if options.machine_readable
        else _TerminalReport(options.stopper)
    )
    report: Report = chosen
    logger = logging.getLogger("lipmotion")
    handler = _ReportHandler(report)
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield report
    finally:
        chosen.close()
        logger.removeHandler(handler)
        logger.propagate = True


class _ReportHandler(logging.Handler):
    def __init__(self, report: Report) -> None:
        super().__init__(logging.WARNING)
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        self._report.warn(record.getMessage())


class _TerminalReport:
    """A progress bar and warnings on standard error, the bar only on a terminal; the result on standard output."""

    def __init__(self, stopper: Stopper) -> None:
        self._stopper = stopper
        self._shown = sys.stderr is not None and sys.stderr.isatty()
        self._bar: Any = None

    def receive(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._draw(event)
        elif event.reason:
            self.warn(f"{event.outcome} {event.name}: {event.reason}")

    def warn(self, text: str) -> None:
        text = f"warning: {text}"
        if self._bar is None:
            print_error(text)
        else:
            self._bar.write(with_program_name(text), file=sys.stderr)

    def finish(self, text: str, **_: Any) -> None:
        self.close()
        self._stopper.settle()
        if text:
            print_lines(text)

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


class _MachineReport:
    """JSON events for the calling program."""

    def __init__(self, stopper: Stopper, events: JsonLines) -> None:
        self._stopper, self._events = stopper, events

    def receive(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._events.emit(
                "progress", stage=event.stage, step=event.step, steps=event.steps, value=round(event.share, 4)
            )
        else:
            self._events.emit("item", name=event.name, outcome=event.outcome, reason=event.reason)

    def warn(self, text: str) -> None:
        self._events.emit("warning", message=text)

    def finish(self, text: str, **figures: Any) -> None:  # noqa: ARG002
        self._stopper.settle()
        self._events.succeed(**figures)

    def close(self) -> None:
        """Do nothing: there is no progress bar to remove."""
