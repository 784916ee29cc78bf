"""What long work says of itself while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

ItemT = TypeVar("ItemT")


@dataclass(frozen=True)
class Progress:
    """Where the work stands.

    stage  : what is being done, in plain words
    step, steps : how many parts of this stage are done, of how many
    share  : how much of the whole work is done, 0 to 1
    figure : of the last step (in training, the mean log likelihood a frame), or None
    """

    stage: str
    step: int
    steps: int
    share: float
    figure: float | None = None


@dataclass(frozen=True)
class Item:
    """What became of one recording.

    outcome : ``prepared``, ``kept`` (was there already) or ``skipped``
    reason  : why it was skipped, or what else there is to know of it
    """

    name: str
    outcome: str
    reason: str = ""


Monitor = Callable[[Progress | Item], None]
"""Called with everything that is worth telling, in the order in which it happens."""


def silent_monitor(event: Progress | Item) -> None:
    """Report nothing."""


def sub_monitor(monitor: Monitor, start: float, stop: float, prefix: str = "") -> Monitor:
    """Return a monitor for a part of the work: all of it is what lies between the shares ``start`` and ``stop``.

    prefix : comes before the name of every stage
    """

    def inside(event: Progress | Item) -> None:
        if isinstance(event, Progress):
            event = replace(event, stage=prefix + event.stage, share=start + event.share * (stop - start))
        monitor(event)

    return inside


def with_progress(items: Sequence[ItemT], stage: str, monitor: Monitor) -> Iterator[ItemT]:
    """Give the items one by one, reporting how many have been dealt with."""
    for number, item in enumerate(items):
        monitor(Progress(stage, number, len(items), number / len(items)))
        yield item
    monitor(Progress(stage, len(items), len(items), 1.0))
