"""Executors by name: this process, processes of this computer, a Dask cluster, MPI."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial

KINDS = ("here", "processes", "dask", "dask:ADDRESS", "mpi")


@contextmanager
def executor(name: str, jobs: int) -> Iterator[Executor | Callable[[], Executor] | None]:
    """Open an executor for `Study.run`, and close it afterwards.

    Args:
        name: "here" for this process; "processes"; "dask" for a cluster of this computer, "dask:ADDRESS" for a
            scheduler that runs elsewhere; "mpi" for a program started by mpiexec -m mpi4py.futures.
        jobs: number of processes; the two last kinds ignore it.

    Raises:
        ValueError: no such name.
        ImportError: a library is not installed; the message says how to install it.
        OSError: there is no scheduler at the address.
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
            raise ImportError('executor "dask" needs Dask: pip install distributed') from None
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
        except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py is there, the MPI library is not
            raise ImportError(
                f'executor "mpi" needs mpi4py and an MPI library: pip install mpi4py, and Open MPI or MPICH ({error})'
            ) from None
        with MPIPoolExecutor() as pool:
            yield pool
    else:
        raise ValueError(f"executor: got {name!r}, expected one of {', '.join(KINDS)}")
