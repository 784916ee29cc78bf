"""The same function for many items, one after another or in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar

GivenT = TypeVar("GivenT")
FoundT = TypeVar("FoundT")


class ParallelMap(Protocol):
    """As the built-in ``map``: results in the order of the items. In other processes, function and items are copied."""

    def __call__(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT], /) -> Iterator[FoundT]:
        """Return the function's results."""
