"""Long work as a person follows it on a terminal, or as a program does (docs/long-work.md)."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from lipmotion.cli.outcome import outcome
from lipmotion.cli.output import refused
from lipmotion.cli.stop import MESSAGE, Stopper
from lipmotion.json_text import as_json, defined
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
    """Give what the work reports to, while it lasts; to a program, say also how it started and why it failed."""
    report = _Lines(options.stopper) if options.machine_readable else _Terminal(options.stopper)
    logger = logging.getLogger("lipmotion")
    handler = _Warnings(report)
    logger.addHandler(handler)
    logger.propagate = False
    try:
        with report:
            yield report
    finally:
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

    def __enter__(self) -> None:
        """Begin."""

    def __exit__(self, *_: object) -> None:
        self._close()

    def hear(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._draw(event)
        elif event.reason:
            self.warn(f"{event.outcome} {event.name}: {event.reason}")

    def warn(self, text: str) -> None:
        line = f"lipmotion: warning: {' '.join(text.split())}"
        if self._bar is None:
            print(line, file=sys.stderr)
        else:
            self._bar.write(line, file=sys.stderr)

    def finish(self, text: str, **_: Any) -> None:
        self._close()
        print(text)

    def _draw(self, event: Progress) -> None:
        if not self._shown:
            return
        from tqdm import tqdm

        stage = f"{event.stage} ({event.step}/{event.steps})"
        if self._bar is None:
            layout = "{desc} {percentage:3.0f}% |{bar:20}| {elapsed}, left {remaining}"
            self._bar = tqdm(total=1.0, initial=event.share, desc=stage, bar_format=layout, dynamic_ncols=True)
        self._bar.set_description_str(stage, refresh=False)
        self._bar.update(event.share - self._bar.n)
        self._bar.refresh()

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _Lines:
    """One JSON object a line on standard output."""

    def __init__(self, stopper: Stopper) -> None:
        self._stopper, self._refused = stopper, False

    def __enter__(self) -> None:
        self._say("start")

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if error is None:
            return
        stopped = isinstance(error, KeyboardInterrupt) or self._stopper.code is not None
        known = (self._stopper.code or 130, MESSAGE) if stopped else outcome(error)
        code, reason = known or (1, f"{type(error).__name__}: {error}")
        self._say("failure", reason=reason, exit_code=code)

    def hear(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            self._say("progress", stage=event.stage, step=event.step, steps=event.steps, value=round(event.share, 4))
        else:
            self._say("item", name=event.name, outcome=event.outcome, reason=event.reason)

    def warn(self, text: str) -> None:
        self._say("warning", message=text)

    def finish(self, text: str, **figures: Any) -> None:  # noqa: ARG002
        self._say("success", **figures)

    def _say(self, kind: str, /, **fields: Any) -> None:
        if not self._refused:
            try:
                print(as_json(defined({"type": kind, **fields})), flush=True)
            except OSError as error:  # a full disk, or a reader that has gone: then there is nobody to work for
                self._refused = True
                raise refused(error) from error
