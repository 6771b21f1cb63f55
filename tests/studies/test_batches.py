"""Calls that are sent in batches: the same results, failures alone, lost batches sent again one by one."""

import os
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from catalogue.studies import carts, plain

from ocp import Study
from ocp.studies.batches import Batches


def inverse(x):
    return 1.0 / x


class Counting(ThreadPoolExecutor):
    sent = 0

    def submit(self, *call):
        self.sent += 1
        return super().submit(*call)


def test_batches_give_the_results_of_single_calls():
    inner = Counting(2)
    with Batches(inner, 10) as pool:
        table = Study(plain, over={"a": range(95)}, neighbours=False).run(pool)
    np.testing.assert_array_equal(table["value"], np.arange(95) + 2.0)
    assert inner.sent == 10
    with Batches(ThreadPoolExecutor(2), 4) as pool:
        rows = [(r.id, r.way, dict(r.results)) for r in carts().run(pool).records]
    assert rows == [(r.id, r.way, dict(r.results)) for r in carts().run().records]


def test_a_call_that_raises_fails_alone():
    with Batches(ThreadPoolExecutor(1), 5) as pool:
        futures = [pool.submit(inverse, x) for x in (1.0, 0.0, 2.0)]
        assert [future.exception() is None for future in futures] == [True, False, True]
        assert futures[2].result() == 0.5


class Losing(Executor):
    """Loses every batch in which a call is about 3; nothing else."""

    def submit(self, function, calls):
        future = Future()
        if any(arguments == (3,) for _, arguments in calls):
            future.set_exception(BrokenExecutor("gone"))
        else:
            future.set_result(function(calls))
        return future


def test_calls_of_a_lost_batch_are_sent_again_one_by_one():
    pool = Batches(Losing(), 4)
    futures = [pool.submit(abs, -x if x != 3 else 3) for x in range(8)]
    assert [future.exception() is None for future in futures] == [x != 3 for x in range(8)]
    assert [future.result() for future in futures if future.exception() is None] == [0, 1, 2, 4, 5, 6, 7]


def test_bad_arguments():
    with pytest.raises(TypeError, match="executor"):
        Batches(os, 3)
    with pytest.raises(ValueError, match="size"):
        Batches(ThreadPoolExecutor(1), 0)
