"""Processes that share a long job, and end with it however it ends.

Not ``concurrent.futures``: where a process is killed while it sends a large result, that waits for the rest for ever.
Here every worker has a pipe of its own, whose end is noticed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from multiprocessing import connection as pipes
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from lipmotion.errors import CorpusError
from lipmotion.kernels.threads import one_thread

GivenT = TypeVar("GivenT")
FoundT = TypeVar("FoundT")


class Workers:
    """Calls functions of modules, which must not depend on anything but their argument.

    With one worker, in this process. Otherwise a script must be guarded by ``if __name__ == "__main__":``.
    Take all results before asking for others.
    """

    def __init__(self, ends: Sequence[Any]) -> None:
        self._ends = ends

    def ordered_map(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT], /) -> Iterator[FoundT]:
        """Yield the results in the order of the items. Raises CorpusError: a process died."""
        found: dict[int, FoundT] = {}
        wanted = 0
        for number, result in self._numbered(function, items):
            found[number] = result
            while wanted in found:
                yield found.pop(wanted)
                wanted += 1

    def unordered_map(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT]) -> Iterator[FoundT]:
        """Yield the results in the order in which they are ready. Raises CorpusError: a process died."""
        return (result for _, result in self._numbered(function, items))

    def _numbered(self, function: Callable[[GivenT], FoundT], items: Iterable[GivenT]) -> Iterator[tuple[int, FoundT]]:
        if not self._ends:
            yield from enumerate(map(function, items))
            return
        left, busy = enumerate(items), dict[Any, int]()

        def occupy(end: Any) -> None:
            for number, item in islice(left, 1):
                _send(end, (function, item))
                busy[end] = number

        for end in self._ends:
            occupy(end)
        while busy:
            for end in pipes.wait(list(busy)):
                number = busy.pop(end)
                good, result = _received(end)
                occupy(end)
                if not good:
                    raise result
                yield number, result


@contextmanager
def worker_pool(count: int) -> Iterator[Workers]:
    """Give ``count`` workers; their processes end when the block is left, at once if by an exception.

    Matrix products use one thread inside the block and in every worker, so that results do not depend on ``count``.
    """
    with one_thread(), ExitStack() as stack:
        if count <= 1:
            yield Workers(())
            return
        yield Workers([stack.enter_context(_worker()) for _ in range(count)])


@contextmanager
def _worker() -> Iterator[Any]:
    """Start a process; give this process's end of the pipe to it."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_work, args=(there,), daemon=True)
    try:
        with _signals_held():
            process.start()
        there.close()  # the process alone has it: when it ends, so does the pipe
        yield here
    except BaseException:
        _kill(process)
        raise
    finally:
        here.close()  # no more work for it
        if process.pid is not None:
            process.join()


def _kill(process: BaseProcess) -> None:
    if process.pid is not None:
        process.kill()


def _send(end: Any, work: Any) -> None:
    try:
        end.send(work)
    except OSError as error:
        raise _died() from error


def _received(end: Any) -> Any:
    try:
        return end.recv()
    except (EOFError, OSError) as error:
        raise _died() from error


def _died() -> CorpusError:
    return CorpusError(
        "a worker process died (out of memory? or a script that does this outside of "
        '`if __name__ == "__main__":`); what is finished is kept: run it again, with fewer workers'
    )


@contextmanager
def _signals_held() -> Iterator[None]:
    """Hold Ctrl-C and ``kill`` back for a moment, and from processes that are started meanwhile for ever.

    The terminal sends Ctrl-C to all of them, but only the first one, which ends the others, should act on it. A mask
    alone does not hold them back here: any other thread, such as those of a BLAS, takes them, and Python answers in
    this one.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # else it starts with the first process, and lets go of the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    came: list[int] = []
    answers = _answered_by(lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, answer in answers.items():
            signal.signal(number, answer)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in came[:1]:
            signal.raise_signal(number)


def _answered_by(handler: Callable[[int, Any], None]) -> dict[int, Any]:
    """Answer signals that are not ignored by ``handler``; return what answered them before.

    Only the main thread may; in others, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    old: dict[int, Any] = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    old = {number: answer for number, answer in old.items() if answer not in (None, signal.SIG_IGN)}
    for number in old:
        signal.signal(number, handler)
    return old


def _work(end: Any) -> None:
    """Do what is asked for until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be held back
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with one_thread():
        while True:
            try:
                function, item = end.recv()
            except EOFError:
                return
            try:
                answer = True, function(item)
            except Exception as error:
                answer = False, error
            end.send(answer)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
