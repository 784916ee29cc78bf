"""Processes that share a long job, and end with it however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

from lipmotion.errors import CorpusError

GivenT = TypeVar("GivenT")
FoundT = TypeVar("FoundT")


class Workers:
    """Calls functions of modules, which must not depend on anything but their argument.

    With one worker, in this process. Otherwise a script must be guarded by ``if __name__ == "__main__":``.
    """

    def __init__(self, pool: ProcessPoolExecutor | None) -> None:
        self._pool = pool

    def each(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT], /) -> Iterator[FoundT]:
        """Yield the results in the order of the items. Raises CorpusError: a process died."""
        if self._pool is None:
            yield from map(function, items)
        else:
            for future in self._started(self._pool, function, items):
                yield _result(future)

    def as_they_come(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT]) -> Iterator[FoundT]:
        """Yield the results in the order in which they are ready. Raises CorpusError: a process died."""
        if self._pool is None:
            yield from map(function, items)
        else:
            for future in as_completed(self._started(self._pool, function, items)):
                yield _result(future)

    def _started(
        self, pool: ProcessPoolExecutor, function: Callable[[GivenT], FoundT], items: Iterable[GivenT]
    ) -> list[Future[FoundT]]:
        try:
            with _signals_held():  # processes are started when there is something to do
                return [pool.submit(function, item) for item in items]
        except BrokenProcessPool as error:
            raise _died() from error


@contextmanager
def working(count: int) -> Iterator[Workers]:
    """Give ``count`` workers; their processes end when the block is left, in a hurry if by an exception."""
    if count <= 1:
        yield Workers(None)
        return
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _start)
    try:
        yield Workers(pool)
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        started = set(multiprocessing.active_children()) - others
        for process in started:
            process.kill()
        for process in started:
            process.join()
        raise
    finally:
        pool.shutdown()


def _result(future: Future[FoundT]) -> FoundT:
    try:
        return future.result()
    except BrokenProcessPool as error:
        raise _died() from error


def _died() -> CorpusError:
    return CorpusError(
        "a worker process died (out of memory? or a script that does this outside of "
        '`if __name__ == "__main__":`); what is finished is kept: run it again, with fewer workers'
    )


@contextmanager
def _signals_held() -> Iterator[None]:
    """Hold Ctrl-C and ``kill`` back for a moment, and from processes that are started meanwhile for ever.

    The terminal sends Ctrl-C to all of them, but only the first one, which ends the others, should act on it.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be held back
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
