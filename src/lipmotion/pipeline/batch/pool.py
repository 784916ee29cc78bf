"""Workers of a batch: processes of this machine by joblib, or those of a Dask cluster, by the same call."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

from lipmotion.errors import CorpusError, InputError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.kernels.threads import one_thread

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
PARENT_CHECK_S = 0.2
CONNECT_S = 20
GRACE_S = 5.0
ITEMS_AHEAD = 4
"""Items a worker that are sent ahead: with ``Parallel``'s own bundles of short items none waits, and memory is flat."""


class WorkerDied(Exception):  # noqa: N818 # an event that the batch survives
    """A worker process ended while it had work."""


class Pool(Protocol):
    """Applies a function to items in other processes; yields results as they are ready.

    Raises WorkerDied: a worker ended; which items are done is not known.
    """

    def __call__(self, function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        """Yield the result of every item, in any order."""


@contextmanager
def local_pool(jobs: int) -> Iterator[Pool]:
    """Give a pool of processes on this machine; with one job, this process itself.

    jobs : number of processes
    """
    from joblib.externals.loky import get_reusable_executor

    if jobs == 1:
        with one_thread():
            yield _pool({"backend": "sequential"})
        return
    _start_tracker()
    shown, ended = threading.excepthook, threading.Event()
    threading.excepthook = _reporter(shown, ended)
    try:
        yield _pool({"backend": "loky", "n_jobs": jobs, "initializer": _begin_worker, "initargs": (os.getpid(),)})
    finally:
        get_reusable_executor(max_workers=jobs).shutdown(wait=True, kill_workers=True)
        ended.set()
        threading.excepthook = shown


def _start_tracker() -> None:
    """Start loky's process that deletes what killed processes leave, and let it do so without a word."""
    from joblib.externals.loky.backend.resource_tracker import ensure_running

    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = "ignore"
    try:
        ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


def _reporter(shown: Callable[[Any], object], ended: threading.Event) -> Callable[[Any], None]:
    """Return a hook for errors of threads that reports them by ``shown``, unless the pool ends within ``GRACE_S``.

    A thread of loky's fails when it meets work that was withdrawn, because a signal has come.
    """

    def report(error: Any) -> None:
        if not ended.wait(GRACE_S):
            shown(error)

    return lambda error: threading.Thread(target=report, args=(error,), daemon=True).start()


@contextmanager
def cluster_pool(address: str, out: Path) -> Iterator[Pool]:
    """Give the workers of a Dask cluster as a pool.

    address : of its scheduler, as ``tcp://HOST:8786``
    out     : the folder of the outputs, which every worker must see under the same path
    Raises MissingDependencyError: the package distributed is not installed.
    Raises InputError: no cluster answers, it has no workers, or they lack lipmotion, its version or the folder.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingDependencyError(
            f"a cluster needs the package distributed: {install_command('cluster')}, here and on all workers"
        ) from error
    with ExitStack() as stack:
        try:
            client = stack.enter_context(Client(address, timeout=CONNECT_S, set_as_default=False))
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(f"{address}: no Dask scheduler answers ({error}); start one: dask scheduler") from error
        _check_workers(client, address, out)
        yield _pool({"backend": "dask", "client": client, "pure": False})


def _check_workers(client: Any, address: str, out: Path) -> None:
    """Raise InputError unless there are workers, and all of them can do the work."""
    from lipmotion.extensions import installed_version

    try:
        found = client.run(_ability, str(out), on_error="return")
    except Exception as error:  # what the scheduler could not send
        raise InputError(f"{address}: the workers cannot be asked ({error})") from error
    if not found:
        raise InputError(f"{address}: the cluster has no workers; start some: dask worker {address} --nthreads 1")
    for worker, answer in found.items():
        if isinstance(answer, BaseException):
            raise InputError(
                f"{worker}: this worker cannot run lipmotion ({answer}); install the same version there"
            ) from answer
        version, sees = answer
        if version != installed_version():
            raise InputError(f"{worker}: has lipmotion {version}, required {installed_version()}; install it there")
        if not sees:
            raise InputError(f"{worker}: does not see the folder {out}; use one that all machines share")


def _ability(out: str) -> tuple[str, bool]:
    from lipmotion.extensions import installed_version

    return installed_version(), os.path.isdir(out)  # noqa: PTH112


def _pool(chosen: dict[str, Any]) -> Pool:
    """Return the pool of a backend of joblib."""
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.process_executor import BrokenProcessPool

    def each(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
        with parallel_config(**chosen):
            results = Parallel(return_as="generator_unordered", pre_dispatch=f"{ITEMS_AHEAD}*n_jobs")(
                delayed(function)(item) for item in items
            )
            try:
                yield from results
            except BrokenProcessPool as error:
                raise WorkerDied(str(error)) from error
            except Exception as error:
                if type(error).__name__ == "KilledWorker":
                    raise WorkerDied(str(error)) from error
                raise
            finally:
                results.close()

    return each


def _begin_worker(parent: int) -> None:
    """Prepare a worker process: Ctrl-C is for the first process, and no worker outlives it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK_S)
    os._exit(1)


def died_alone(name: str) -> CorpusError:
    """Return the error of a line whose worker died twice, once while it had no other work."""
    return CorpusError(f"{name}: the process that worked on it died (out of memory?); is the recording damaged?")
