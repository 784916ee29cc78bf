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

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.extensions import install_command, installed_version
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
    from joblib.externals.loky.backend.resource_tracker import ensure_running

    if jobs == 1:
        with one_thread():
            yield _pool({"backend": "sequential"})
        return
    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = "ignore"
    try:
        ensure_running()  # loky's process, which deletes what killed processes leave, without a word
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before
    report, ended = threading.excepthook, threading.Event()

    def report_late(error: Any) -> None:
        """Report an error of a thread unless the pool ends soon: a signal withdraws work that loky's threads meet."""
        if not ended.wait(GRACE_S):
            report(error)

    threading.excepthook = lambda error: threading.Thread(target=report_late, args=(error,), daemon=True).start()
    try:
        yield _pool({"backend": "loky", "n_jobs": jobs, "initializer": begin_worker, "initargs": (os.getpid(),)})
    finally:
        get_reusable_executor(max_workers=jobs).shutdown(wait=True, kill_workers=True)
        ended.set()
        threading.excepthook = report


def begin_worker(parent: int) -> None:
    """Prepare a worker process: Ctrl-C is for the first process, and no worker outlives it."""

    def end_with_parent() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_S)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        threading.Thread(target=end_with_parent, daemon=True).start()


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
        try:
            answers = client.run(describe_worker, str(out), on_error="return")
        except Exception as error:  # what the scheduler could not send
            raise InputError(f"{address}: the workers cannot be asked ({error})") from error
        if not answers:
            raise InputError(f"{address}: the cluster has no workers; start some: dask worker {address} --nthreads 1")
        for worker, answer in answers.items():
            if isinstance(answer, BaseException):
                raise InputError(
                    f"{worker}: this worker cannot run lipmotion ({answer}); install the same version there"
                ) from answer
            version, sees_folder = answer
            if version != installed_version():
                raise InputError(f"{worker}: has lipmotion {version}, required {installed_version()}; install it there")
            if not sees_folder:
                raise InputError(f"{worker}: does not see the folder {out}; use one that all machines share")
        yield _pool({"backend": "dask", "client": client, "pure": False})


def describe_worker(out: str) -> tuple[str, bool]:
    """Return a worker's version of lipmotion, and whether it sees a folder."""
    return installed_version(), os.path.isdir(out)  # noqa: PTH112


def _pool(chosen: dict[str, Any]) -> Pool:
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
