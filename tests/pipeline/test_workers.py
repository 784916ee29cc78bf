from __future__ import annotations

import os
import signal
import sys

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


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
def test_workers_leave_signals_to_the_process_that_started_them() -> None:
    with working(2) as team:
        assert all(team.each(held, range(4)))
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, ()) & {signal.SIGINT, signal.SIGTERM}
