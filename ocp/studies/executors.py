"""Executors by name: here, processes of this machine, a Dask cluster, MPI."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial

KINDS = ("here", "processes", "dask", "dask:ADDRESS", "mpi")
Run = Executor | Callable[[], Executor] | None


@contextmanager
def executor(name: str, jobs: int) -> Iterator[Run]:
    """Open an executor, and close it afterwards.

    Args:
        name: "here"; "processes"; "dask" for a cluster of this machine, "dask:ADDRESS" for a running scheduler; "mpi"
            under mpiexec -m mpi4py.futures.
        jobs: number of processes.

    Raises:
        ValueError: no such name.
        ImportError: the library of an extra is missing; the message names the extra.
        OSError: no scheduler answers.
    """
    kind, _, address = name.partition(":")
    if kind == "here":
        yield None
    elif kind == "processes":
        # Spawned processes inherit no locks and no threads of this one.
        yield partial(ProcessPoolExecutor, jobs, multiprocessing.get_context("spawn"))
    elif kind == "dask":
        try:
            from distributed import Client, LocalCluster
        except ImportError:
            raise ImportError('--executor dask needs Dask: pip install "hamel[cluster]"') from None
        if address:
            with Client(address, timeout=10) as client:
                yield client.get_executor()
        else:
            local = LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=None)
            with local as cluster, Client(cluster) as client:
                yield client.get_executor()
    elif kind == "mpi":
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError:
            raise ImportError("--executor mpi needs mpi4py and an MPI library: pip install mpi4py") from None
        with MPIPoolExecutor() as pool:
            yield pool
    else:
        raise ValueError(f"--executor: got {name!r}, expected one of {', '.join(KINDS)}")
