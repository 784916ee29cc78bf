"""The type of functions that apply a function to many items, in one process or in several."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


class ParallelMap(Protocol):
    """A function as the built-in ``map``, which may run in several processes: function and items are then copied."""

    def __call__(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        """Return the results of the function, in the order of the items."""
