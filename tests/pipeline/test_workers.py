from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator

import pytest

from lipmotion.errors import CorpusError, InputError
from lipmotion.pipeline.workers import working


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


@pytest.mark.parametrize("count", [0, 1, 2])
def test_results_come_in_order(count: int) -> None:
    with working(count) as team:
        assert list(team.each(square, range(20))) == [number * number for number in range(20)]
        assert list(team.each(square, [])) == []
        assert sorted(team.as_they_come(square, range(20))) == [number * number for number in range(20)]


def test_one_worker_is_this_process_and_several_are_others() -> None:
    with working(1) as team:
        assert set(team.each(whose, range(3))) == {os.getpid()}
    with working(2) as team:
        assert os.getpid() not in set(team.each(whose, range(3)))


@pytest.mark.parametrize("count", [1, 2])
def test_errors_come_back(count: int) -> None:
    with pytest.raises(InputError, match="less than nothing"), working(count) as team:
        list(team.each(square, [1, -1, 2]))


def test_a_worker_that_dies_is_a_clear_error() -> None:
    with pytest.raises(CorpusError, match="a worker process died"), working(2) as team:
        list(team.each(die, [0, 1, 0]))


def large(_: int) -> bytes:
    return bytes(50_000_000)


@pytest.mark.parametrize("_", range(5))
def test_a_worker_that_is_ended_while_it_sends_does_not_block(_: int) -> None:
    """Its result is larger than the pipe holds, so it is sending when the block is left."""
    before = set(multiprocessing.active_children())

    def interrupted() -> None:
        with working(2) as team:
            next(team.as_they_come(large, range(10)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert set(multiprocessing.active_children()) == before


def killed_while_sending(_: int) -> bytes:
    threading.Timer(0.3, os._exit, (1,)).start()
    return bytes(2_000_000_000)


def test_a_worker_that_dies_while_it_sends_is_a_clear_error() -> None:
    with pytest.raises(CorpusError, match="a worker process died"), working(2) as team:
        list(team.each(killed_while_sending, range(2)))


def test_items_are_taken_when_they_are_needed() -> None:
    taken = []

    def items() -> Iterator[int]:
        for number in range(20):
            taken.append(number)
            yield number

    with working(2) as team:
        results = team.as_they_come(square, items())
        next(results)
        assert len(taken) <= 4
        assert len(list(results)) == 19


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_workers_leave_signals_to_the_process_that_started_them() -> None:
    with working(2) as team:
        assert all(team.each(held, range(4)))
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & {signal.SIGINT, signal.SIGTERM}
