from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from lipmotion.kernels.compiler import blas_kernels, one_thread


def threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_outside():
    with threadpool_limits(2, user_api="blas"):
        yield


def test_one_inside_and_as_before_afterwards_also_after_an_error():
    with one_thread():
        assert threads() == {1}
        with one_thread():
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(KeyError), one_thread():
        raise KeyError
    assert threads() == {2}
    counted = one_thread()(threads)
    assert [counted(), counted()] == [{1}, {1}]


def test_blocks_that_overlap_in_threads_of_python_leave_nothing_behind():
    """The second begins inside the first and ends after it."""
    both_in, first_out = Barrier(2), Barrier(2)

    def first():
        with one_thread():
            both_in.wait(20)
        first_out.wait(20)

    def second():
        with one_thread():
            both_in.wait(20)
            first_out.wait(20)

    with ThreadPoolExecutor(2) as pool:
        for job in [pool.submit(first), pool.submit(second)]:
            job.result()
    assert threads() == {2}


def test_kernels_are_named():
    assert blas_kernels() == blas_kernels() == sorted(blas_kernels())
    assert all(len(name.split()) >= 3 for name in blas_kernels())


def test_the_limit_lasts_until_the_last_thread_leaves():
    """Of two Python threads the first leaves while the second one still computes."""
    first, second = one_thread(), one_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert threads() == {1}
    second.__exit__(None, None, None)
    assert threads() == {2}
