"""Worker processes that share a long job, and that end when it ends, for whatever reason.

``concurrent.futures`` is not used: if a process is killed while it sends a large result, it waits for the rest forever.
Here every worker has a pipe of its own, and the end of a pipe is detected.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import platform
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import chain, islice
from multiprocessing import connection as pipes
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

from lipmotion.errors import CorpusError, InputError, MissingDependencyError
from lipmotion.extensions import find_version, install_command
from lipmotion.kernels.compiler import limit_threads, list_blas_kernels
from lipmotion.types import ParallelMap

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


class WorkerDiedError(CorpusError):
    """A worker process ended while it had work."""


def process_count(count: int | None) -> int:
    """Return how many processes share the work; None: one a core. Raises InputError: fewer than one."""
    if count is not None and count < 1:
        raise InputError(f"{count} processes, required 1 or more; leave the number out for one a core")
    return count or os.cpu_count() or 1


def _in_order(numbered: Iterator[tuple[int, ResultT]]) -> Iterator[ResultT]:
    waiting, following = dict[int, ResultT](), 0
    for number, result in numbered:
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


class Workers:
    """Applies functions to items in worker processes, or in this process if there are none.

    A function must be defined in a module and depend on its argument alone. With worker processes, a script must be
    guarded by ``if __name__ == "__main__":``. All results of a call must be taken before the next call.
    """

    def __init__(self, ends: Sequence[Any]) -> None:
        self._ends = ends

    def ordered_map(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        """Yield the results in the order of the items. The first items are sent at once.

        Raises WorkerDiedError: a process died.
        """
        return _in_order(self._numbered(function, items))

    def unordered_map(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT]) -> Iterator[ResultT]:
        """Yield the results in the order in which they are ready. Raises WorkerDiedError: a process died."""
        return (result for _, result in self._numbered(function, items))

    def _numbered(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT]) -> Iterator[tuple[int, ResultT]]:
        if not self._ends:
            return enumerate(map(function, items))
        remaining, busy = enumerate(items), dict[Any, int]()

        def send_next(end: Any) -> None:
            for number, item in islice(remaining, 1):
                try:
                    end.send((function, item))
                except OSError as error:
                    raise WorkerDiedError(DIED) from error
                busy[end] = number

        def results() -> Iterator[tuple[int, ResultT]]:
            while busy:
                end: Any
                for end in pipes.wait(list(busy)):
                    number = busy.pop(end)
                    try:
                        succeeded, result = end.recv()
                    except (EOFError, OSError) as error:
                        raise WorkerDiedError(DIED) from error
                    send_next(end)
                    if not succeeded:
                        raise result
                    yield number, result

        for end in self._ends:
            send_next(end)
        return results()


@contextmanager
def open_workers(count: int) -> Iterator[Workers]:
    """Provide ``count`` workers; their processes end when the block is left, immediately if by an exception.

    Matrix products use one thread inside the block and in every worker, so that results do not depend on ``count``.
    """
    context = multiprocessing.get_context("spawn")

    @contextmanager
    def start_worker() -> Iterator[Any]:
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there,), daemon=True)
        try:
            with _delay_signals():
                process.start()
            there.close()  # the process alone has it: when it ends, so does the pipe
            yield here
        except BaseException:
            if process.pid is not None:
                process.kill()
            raise
        finally:
            here.close()  # tells the worker to end
            if process.pid is not None:
                process.join()

    with limit_threads(), ExitStack() as stack:
        yield Workers([stack.enter_context(start_worker()) for _ in range(count if count > 1 else 0)])


def map_in_processes(count: int, background: Callable[[], None] | None = None) -> ParallelMap:
    """Return a map whose calls start up to ``count`` processes, and end them; of one item or none, no process.

    The processes begin with the first items when the map is called: the caller can work beside them, and then take the
    results.
    background : is called once, where processes work, before the first result is waited for
    """
    count = process_count(count)

    def start(processes: int, function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        """Yield None when the processes have begun with the first items, then the results."""
        with open_workers(processes) as team:
            results = team.ordered_map(function, items)
            yield None
            if background is not None and processes > 1:
                background()
            yield from results

    def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        waiting = iter(items)
        first = list(islice(waiting, count))
        results = start(len(first), function, chain(first, waiting))
        next(results)
        return results

    return each


def start_process(
    function: Callable[[ItemT, Callable[[Any], None]], None], item: ItemT
) -> tuple[BaseProcess, pipes.Connection[Any, Any]]:
    """Begin work in a process of its own, which may start workers; return the process, and the end of its pipe.

    function : called there with the item, and with a function that sends what it is given through the pipe
    The pipe ends with the process. The process and its workers end at its ``kill``, which is delayed by nothing, and
    when this process ends, for whatever reason; signals are not for it.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_apart, args=(there, function, item))
    with _delay_signals():
        process.start()
    there.close()
    return process, here


def _apart(end: Any, function: Callable[[Any, Callable[[Any], None]], None], item: Any) -> None:
    _begin_below()
    function(item, end.send)


DIED = (
    "a worker process died (out of memory? or a script that does this outside of "
    '`if __name__ == "__main__":`); what is finished is kept: run it again, with fewer workers'
)


@contextmanager
def _delay_signals() -> Iterator[None]:
    """Delay Ctrl-C and ``kill`` inside the block, and block them forever in processes that are started inside it.

    The terminal sends Ctrl-C to all processes, but only the first one, which ends the others, should act on it. A mask
    alone does not delay the signals in this process: another thread, for instance of a BLAS, receives them, and Python
    runs their handlers in this one.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # else it starts with the first process, and unblocks the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    received: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # no other thread may set handlers
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        handlers = {number: handler for number, handler in handlers.items() if handler not in (None, signal.SIG_IGN)}
    for number in handlers:
        signal.signal(number, lambda received_number, _: received.append(received_number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in received[:1]:
            signal.raise_signal(number)


def _work(end: Any) -> None:
    """Apply the functions that come through the pipe to their items, until the pipe ends."""
    _begin_below()
    with limit_threads():
        while True:
            try:
                function, item = end.recv()
            except EOFError:
                return
            try:
                outcome = True, function(item)
            except Exception as error:
                outcome = False, error
            end.send(outcome)


def _begin_below() -> None:
    """Leave Ctrl-C to the process that started this one, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where signals cannot be delayed

    def end_with_parent() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def open_training(workers: int | str, utterances: int) -> Iterator[ParallelMap]:
    """Give the map that distributes a training, whose results are in the order of the items.

    workers    : number of processes on this machine, or the address of a Dask scheduler
    utterances : how many the training has: few are not worth a further process
    Raises as ``cluster_pool``. The map raises CorpusError: a process died; Dask lets others finish its work, thrice.
    """
    if isinstance(workers, int):
        with open_workers(min(process_count(workers), utterances // UTTERANCES_PER_WORKER)) as team:
            yield team.ordered_map
        return
    with cluster_pool(workers) as pool:

        def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
            return _in_order(pool(partial(_work_alone, function), enumerate(items)))

        yield each


def _work_alone(function: Callable[[ItemT], ResultT], numbered: tuple[int, ItemT]) -> tuple[int, ResultT]:
    with limit_threads():
        return numbered[0], function(numbered[1])


LOG = logging.getLogger("lipmotion")
UTTERANCES_PER_WORKER = 32  # smallest number of utterances for which a further process is started
CONNECT_S = 20
ITEMS_AHEAD = 4  # items a worker of a cluster that are sent ahead, so that none waits, and memory is flat


@contextmanager
def cluster_pool(address: str, out: str | Path = ".") -> Iterator[ParallelMap]:
    """Give a map in the workers of a Dask cluster whose results come as they are ready.

    address : of its scheduler, as ``tcp://HOST:8786``
    out     : the folder of the outputs, which every worker must see under the same path
    A warning says where the last bits of results may differ.
    Raises MissingDependencyError: the package distributed is not installed.
    Raises InputError: no cluster answers, it has no workers, or they lack lipmotion, its version or the folder.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as error:
        advice = f"{install_command('cluster')}, here and on all workers"
        raise MissingDependencyError(f"a cluster needs the package distributed: {advice}") from error
    with ExitStack() as stack:
        try:
            client = stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(f"{address}: no Dask scheduler answers ({error}); start one: dask scheduler") from error
        try:
            answers = client.run(describe_worker, str(out), on_error="return")
        except Exception as error:  # what the scheduler could not send
            raise InputError(f"{address}: the workers cannot be asked ({error})") from error
        if not answers:
            raise InputError(f"{address}: the cluster has no workers; start some: dask worker {address} --nthreads 1")
        for worker, answer in answers.items():
            _check_worker(worker, answer, out)

        def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
            remaining = iter(items)
            first = list(islice(remaining, ITEMS_AHEAD * sum(client.ncores().values())))
            running = as_completed(client.map(function, first, pure=False), loop=client.loop)
            try:
                for future in running:
                    yield future.result()
                    running.update(client.submit(function, item, pure=False) for item in islice(remaining, 1))
            except KilledWorker as error:
                raise WorkerDiedError(str(error)) from error
            finally:
                client.cancel(list(running.futures))

        yield each


def _check_worker(worker: str, answer: Any, out: str | Path) -> None:
    """Raise InputError where a worker cannot do the work; warn where its processor is another kind."""
    if isinstance(answer, BaseException):
        raise InputError(f"{worker}: cannot run lipmotion ({answer}); install the same version there") from answer
    version, sees_folder, processor = answer
    if version != find_version():
        raise InputError(f"{worker}: has lipmotion {version}, required {find_version()}; install it there")
    if processor != describe_worker("")[2]:
        LOG.warning("%s: has another processor (%s): the last bits of results may differ", worker, processor)
    if not sees_folder:
        raise InputError(f"{worker}: does not see the folder {out}; use one that all machines share")


def describe_worker(out: str) -> tuple[str, bool, str]:
    """Return a worker's version of lipmotion, whether it sees a folder, and what kind of processor it has."""
    return find_version(), os.path.isdir(out), f"{platform.machine()} {list_blas_kernels()}"  # noqa: PTH112
