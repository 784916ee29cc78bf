"""Progress and warnings of commands: on a terminal, as events (docs/long-work.md), or as Rhubarb has them."""

from __future__ import annotations

import argparse
import errno
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

from lipmotion.cli.terminal.events import Events, JsonLines, RhubarbStatus, Stopper
from lipmotion.cli.terminal.printing import print_error, print_lines, with_program_name
from lipmotion.errors import ExportError, InputError, LipMotionError
from lipmotion.extensions import describe_failed_extension
from lipmotion.printable import printable
from lipmotion.storage.files import as_text
from lipmotion.types.progress import Item, Monitor, Progress, warnings_to


class Report:
    """Receives the events of long work. A bar and warnings go to standard error, the result to standard output.

    The bar is shown on a terminal only.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self._stopper: Stopper = options.stopper
        self._shown = sys.stderr is not None and sys.stderr.isatty()
        self._bar: Any = None

    def receive(self, event: Progress | Item) -> None:
        """Show or write one event."""
        self._stopper.check()
        if isinstance(event, Item):
            if event.reason:
                self.warn(f"{event.outcome} {event.name}: {event.reason}")
        elif self._shown:
            from tqdm import tqdm

            stage = printable(f"{event.stage} ({event.step}/{event.steps})")
            if self._bar is None:
                layout = "{desc} {percentage:3.0f}% |{bar:20}| {elapsed}, left {remaining}"
                self._bar = tqdm(total=1.0, initial=event.share, desc=stage, bar_format=layout, dynamic_ncols=True)
            self._bar.set_description_str(stage, refresh=False)
            self._bar.update(event.share - self._bar.n)
            self._bar.refresh()

    def warn(self, text: str) -> None:
        """Show or write a warning."""
        text = f"warning: {text}"
        if self._bar is None:
            print_error(text)
        else:
            self._bar.write(with_program_name(text), file=sys.stderr)

    def finish(self, text: str, **figures: Any) -> None:  # noqa: ARG002
        """Give the result: ``text`` for a person, ``figures`` for a program."""
        self.close()
        self._stopper.settle()
        if text:
            print_lines(text)

    def close(self) -> None:
        """Remove what is shown while the work lasts."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


class _MachineReport(Report):
    """JSON events for the calling program."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__(options)
        self._events: JsonLines = options.events

    def receive(self, event: Progress | Item) -> None:
        self._stopper.check()
        if isinstance(event, Progress):
            share = round(event.share, 4)
            self._events.emit("progress", stage=event.stage, step=event.step, steps=event.steps, value=share)
        else:
            self._events.emit("item", name=event.name, outcome=event.outcome, reason=event.reason)

    def warn(self, text: str) -> None:
        self._events.emit("warning", message=text)

    def finish(self, text: str, **figures: Any) -> None:  # noqa: ARG002
        self._stopper.settle()
        self._events.succeed(**figures)


@contextmanager
def report_progress(options: argparse.Namespace) -> Iterator[Report]:
    """Yield the report of a command, to which the package's warnings go, too."""
    report = (_MachineReport if options.machine_readable else Report)(options)
    with warnings_to(report.warn, propagate=False), closing(report):
        yield report


NO_FOLDER = "the current folder has been deleted; go to one that exists"
HEAD_CHARACTERS, TAIL_CHARACTERS = 700, 300
"""Characters of a long line that are shown from its beginning and from its end."""


def describe_outcome(error: BaseException) -> tuple[int, str] | None:
    """Return the exit code and the one-line message of an expected error, or one of an extension; None: a bug."""
    if isinstance(error, LipMotionError):
        return error.exit_code, shorten_line(error)
    if isinstance(error, MemoryError):
        return InputError.exit_code, f"not enough memory ({error}); give a shorter recording or a smaller file"
    if isinstance(error, OSError):  # what the operating system refuses: no permission, a name too long
        nameless = (error.errno, error.strerror, error.filename) == (errno.ENOENT, os.strerror(errno.ENOENT), None)
        return InputError.exit_code, shorten_line(NO_FOLDER if nameless else error)  # the current folder
    failed = describe_failed_extension(error)
    return None if failed is None else (InputError.exit_code, shorten_line(failed))


def shorten_line(message: object) -> str:
    """Return a message as a printable line of limited length; of a longer one, the middle is left out."""
    line = printable(message)
    if len(line) <= HEAD_CHARACTERS + TAIL_CHARACTERS:
        return line
    return f"{line[:HEAD_CHARACTERS]} ... {line[-TAIL_CHARACTERS:]}"


LEVELS = {"trace": 5, "debug": 10, "info": 20, "warning": 30, "error": 40, "fatal": 50}
"""Rhubarb's levels of messages, as numbers of ``logging``."""
_NAMES = {number: name.capitalize() for name, number in LEVELS.items()}


@contextmanager
def print_status_lines(options: argparse.Namespace) -> Iterator[Monitor]:
    """Yield a monitor that shows progress; report success at the end.

    Warnings become events, too, where events are asked for, and go to the log file, where there is one, which is told
    how it ended as well. Raises ExportError: that file cannot be written.
    """
    events: Events = options.events
    root, report = logging.getLogger(), Report(options)
    path, handlers = options.log_file, root.handlers
    log: logging.Handler = logging.NullHandler(LEVELS["fatal"] + 1)
    if path is not None:
        try:
            log = logging.FileHandler(path, mode="w", encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise ExportError(f"{path}: the log cannot be written: {error.strerror or error}") from error
        log.setLevel(LEVELS[options.log_level])
        log.setFormatter(_LogFormatter(datefmt="%Y-%m-%d %H:%M:%S"))
    console = handlers
    if isinstance(events, RhubarbStatus):
        status, console = events, [logging.Handler()]
        console[0].emit = lambda record: status.emit("log", _name_level(record), record.getMessage())  # type: ignore[method-assign]
    root.handlers = [*(console if LEVELS[options.console_level] <= logging.WARNING else ()), log]

    def note(level: str, message: str) -> None:
        if LEVELS[level] >= log.level:
            log.handle(logging.LogRecord("", LEVELS[level], "", 0, message, None, None))

    def receive(event: Progress | Item) -> None:
        done = round(event.share, 4) if isinstance(event, Progress) else 0.0
        note("trace", f"Progress: {done:.0%}")
        if isinstance(events, RhubarbStatus):
            events.emit("progress", "Trace", f"Progress: {done:.0%}", value=done)
        elif done < 1:
            report.receive(event)
        else:
            report.close()

    try:
        note("info", f"Application startup. Input file: {as_text(options.speech)}.")
        yield receive
        options.stopper.settle()
        note("info", "Application terminating normally.")
        if isinstance(events, RhubarbStatus):
            events.succeed()
    except Exception as error:
        known = describe_outcome(error)
        note("fatal", f"Application terminating with error: {known[1] if known else error!r}")
        raise
    finally:
        report.close()
        root.handlers = handlers
        log.close()


class _LogFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return f"[{self.formatTime(record, self.datefmt)}] 1 [{_name_level(record)}] {record.getMessage()}"


def _name_level(record: logging.LogRecord) -> str:
    return _NAMES.get(record.levelno, record.levelname.capitalize())
