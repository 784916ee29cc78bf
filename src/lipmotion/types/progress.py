"""Long work: reports of its progress, monitors, which receive them, warnings, and maps over several processes."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar, cast

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
REPORT_INTERVAL = 10  # every so many pictures are reported


@dataclass(frozen=True)
class Progress:
    """A report of the progress of long work.

    stage  : what is being done, in words
    step   : number of steps of this stage that are done
    steps  : number of all steps of this stage
    share  : share of the whole work that is done, 0 to 1
    figure : result of the last step, or None (in training: the mean log likelihood per frame)
    """

    stage: str
    step: int
    steps: int
    share: float
    figure: float | None = None


@dataclass(frozen=True)
class Item:
    """A report that the work on one recording is finished; of ``lipmotion doctor``, on a part of the installation.

    name    : of the recording, or of an experiment
    outcome : ``prepared``, ``kept`` (it was prepared before) or ``skipped``; of a part, its state; of an experiment,
              ``failed``
    reason  : why it was skipped, or remarks on it
    """

    name: str
    outcome: str
    reason: str = ""


Monitor = Callable[[Progress | Item], None]  # A function that long work calls with its reports, in their order


def silent_monitor(event: Progress | Item) -> None:
    """Ignore all reports."""


def sub_monitor(monitor: Monitor, start: float, stop: float, prefix: str = "") -> Monitor:
    """Return a monitor for a part of the work, which passes its reports on to the monitor of the whole.

    start, stop : shares of the whole work at which the part begins and ends, 0 to 1
    prefix      : put before the name of every stage
    """

    def report(event: Progress | Item) -> None:
        if isinstance(event, Progress):
            event = replace(event, stage=prefix + event.stage, share=start + event.share * (stop - start))
        monitor(event)

    return report


def with_progress(
    items: Iterable[ItemT], stage: str, monitor: Monitor, count: int | None = None, interval: int = 1
) -> Iterator[ItemT]:
    """Yield the items one by one, and report after each ``interval`` of about ``count`` how many are done."""
    steps = len(cast(Sized, items)) if count is None else count
    for number, item in enumerate(items):
        if number % interval == 0:
            monitor(Progress(stage, number, steps, min(number / max(steps, 1), 1.0)))
        yield item
    monitor(Progress(stage, steps, steps, 1.0))


@contextmanager
def warnings_to(receive: Callable[[str], object], *, of_thread: bool = False, propagate: bool = True) -> Iterator[None]:
    """Give the package's warnings to a function; ``of_thread``: this thread's alone; propagate : whether they go on."""
    logger, handler, thread = logging.getLogger("lipmotion"), logging.Handler(logging.WARNING), threading.get_ident()
    handler.emit = lambda record: receive(record.getMessage())  # type: ignore[assignment,method-assign]
    handler.addFilter(lambda record: not of_thread or record.thread == thread)
    logger.addHandler(handler)
    before, logger.propagate = logger.propagate, propagate
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before


class ParallelMap(Protocol):
    """A function as the built-in ``map``, which may run in several processes: function and items are then copied."""

    def __call__(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        """Return the results of the function, in the order of the items."""
