import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator

import pytest

from lipmotion.errors import CorpusError, InputError
from lipmotion.pipeline import workers as module
from lipmotion.pipeline.workers import map_in_processes, open_workers, process_count


def square(number: int) -> int:
    if number < 0:
        raise InputError("less than nothing")
    return number * number


def whose(_: int) -> int:
    return os.getpid()


def die(number: int) -> int:
    if number:
        os._exit(1)
    return number


def held(_: int) -> bool:
    return {signal.SIGINT, signal.SIGTERM} <= signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_no_worker_and_one_are_this_process():
    for count in (0, 1):
        with open_workers(count) as team:
            assert list(team.ordered_map(square, range(20))) == [number * number for number in range(20)]
            assert sorted(team.unordered_map(square, range(20))) == [number * number for number in range(20)]
            assert list(team.ordered_map(square, [])) == []
            assert set(team.ordered_map(whose, range(3))) == {os.getpid()}
            with pytest.raises(InputError, match="less than nothing"):
                list(team.ordered_map(square, [1, -1, 2]))


@pytest.mark.parametrize("given", [0, -1, -(2**70)])
def test_fewer_than_one_process_are_refused(given):
    assert process_count(None) >= 1
    assert process_count(3) == 3
    with pytest.raises(InputError, match="required 1 or more"):
        process_count(given)
    with pytest.raises(InputError, match="required 1 or more"):
        map_in_processes(given)


def test_several_workers_are_other_processes():
    """Results come in order, items are taken when they are needed, errors come back, signals are not for workers."""
    taken = []

    def items() -> Iterator[int]:
        for number in range(20):
            taken.append(number)
            yield number

    with open_workers(2) as team:
        assert list(team.ordered_map(square, range(20))) == [number * number for number in range(20)]
        assert list(team.ordered_map(square, [])) == []
        assert os.getpid() not in set(team.ordered_map(whose, range(3)))
        results = team.unordered_map(square, items())
        first = next(results)
        assert len(taken) <= 4
        assert sorted([first, *results]) == [number * number for number in range(20)]
        if sys.platform != "win32":
            assert all(team.ordered_map(held, range(4)))
        with pytest.raises(InputError, match="less than nothing"):
            list(team.ordered_map(square, [1, -1, 2]))
    if sys.platform != "win32":
        assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & {signal.SIGINT, signal.SIGTERM}


def test_a_worker_that_dies_is_a_clear_error():
    with pytest.raises(CorpusError, match="a worker process died"), open_workers(2) as team:
        list(team.ordered_map(die, [0, 1, 0]))


def large(_: int) -> bytes:
    return bytes(50_000_000)


@pytest.mark.long
def test_a_worker_that_is_ended_while_it_sends_does_not_block():
    """Its result is larger than the pipe holds, so it is sending when the block is left."""
    before = set(multiprocessing.active_children())

    def interrupted() -> None:
        with open_workers(2) as team:
            next(team.unordered_map(large, range(10)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert set(multiprocessing.active_children()) == before


def killed_while_sending(_: int) -> bytes:
    threading.Timer(0.3, os._exit, (1,)).start()
    return bytes(2_000_000_000)


@pytest.mark.long
def test_a_worker_that_dies_while_it_sends_is_a_clear_error():
    with pytest.raises(CorpusError, match="a worker process died"), open_workers(2) as team:
        list(team.ordered_map(killed_while_sending, range(2)))


@pytest.mark.skipif(os.name == "nt", reason="signals are held back on POSIX")
@pytest.mark.usefixtures("ordinary_signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_another_thread_takes_waits_until_a_process_has_started(number):
    """A BLAS has threads that do not mask signals; Python answers what they take in the main thread."""
    over, seen = threading.Event(), []
    other = threading.Thread(target=over.wait)
    signal.signal(number, lambda *_: seen.append("answered"))
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    signal.set_wakeup_fd(theirs.fileno())
    other.start()
    try:
        with module._delay_signals():
            os.kill(os.getpid(), number)
            assert ours.recv(1) == bytes([number])  # it has arrived: were it not held back, it would be answered now
            seen.append("started")
    finally:
        signal.set_wakeup_fd(-1)
        over.set()
        other.join()
        ours.close()
        theirs.close()
    assert seen == ["started", "answered"]


def test_processes_begin_before_results_are_asked_for():
    taken, called = [], []

    def items() -> Iterator[int]:
        for number in range(4):
            taken.append(number)
            yield number

    results = map_in_processes(2, lambda: called.append(True))(square, items())
    assert taken == [0, 1]  # each process has one
    assert not called
    assert list(results) == [0, 1, 4, 9]
    assert called == [True]
    assert list(map_in_processes(2, lambda: called.append(True))(square, [3])) == [9]
    assert called == [True]  # not where there is no process


def test_processes_that_nobody_waits_for_end():
    results = map_in_processes(2)(square, range(9))
    assert multiprocessing.active_children()
    del results
    assert not multiprocessing.active_children()
