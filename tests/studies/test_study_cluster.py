"""Studies on a Dask cluster with a scheduler and two worker processes of this machine; one is killed on the way."""

import os
import signal
import warnings

import numpy as np
import pytest
from catalogue.studies import carts

from ocp import Study, uniform

distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra cluster)")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def client():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        local = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        with local as cluster, distributed.Client(cluster) as opened:
            yield opened


def results(table):
    return [(r.id, r.status, r.way, r.origin, dict(r.results)) for r in table.records]


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_finds_what_one_process_finds(client):
    assert results(carts().run(client.get_executor())) == results(carts().run())


@pytest.mark.filterwarnings("ignore")
def test_a_worker_killed_half_way_costs_nothing_but_time(client):
    wide = dict(over={"mass": np.linspace(0.5, 4.0, 12), "limit": np.linspace(0.5, 2.0, 6)}, grid=uniform(20))
    killed = []

    def watch(progress):
        if progress.done == 30 and not killed:
            killed.append(client.run(os.getpid))
            os.kill(next(iter(killed[0].values())), signal.SIGKILL)

    table = carts(**wide).run(client.get_executor(), watch=watch)
    assert killed
    assert np.all(table.ok)
    assert results(table) == results(carts(**wide).run())


def dies(x):
    if x == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


@pytest.mark.filterwarnings("ignore")
def test_a_case_that_kills_every_worker_fails_alone(client):
    table = Study(dies, over={"x": range(6)}).run(client.get_executor())
    assert list(table.failures) == [3]
    assert "KilledWorker" in table.failures[3]
