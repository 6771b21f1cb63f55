"""Other tools on the problems of the benchmark, each the way its manual does it, where they are installed.

The right-hand side is handed over instruction by instruction; guess, tolerance and, where the tool scales, magnitudes
are the same for all. Every run is a process of its own, bounded in time, after one small run that is not counted.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from benchmark_problems import CASES, Case, Numbers, Outcome, numbers

from ocp import radau

Peer = Callable[[Case, Numbers], Outcome]
WARM_UP = 4  # elements of the run that is not counted
TOLERANCE = 1e-9


def missing(name: str) -> str:
    """Return why a peer cannot run, or an empty string."""
    modules = MODULES[name]
    absent = [module for module in modules if importlib.util.find_spec(module) is None]
    return f"not installed ({', '.join(absent)})" if absent else ""


def run(name: str, problem: str, elements: int, limit: float) -> Outcome:
    """Run a peer in a process of its own, for at most `limit` seconds after its start."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(there, name, problem, elements), daemon=True)
    process.start()
    there.close()
    try:
        if not here.poll(limit):
            return Outcome(note=f"stopped after {limit:g} s")
        found: Outcome = here.recv()
        return found
    except EOFError:
        return Outcome(note="its process died")
    finally:
        process.kill()
        process.join()


def _work(answer: Connection, name: str, problem: str, elements: int) -> None:
    """Run one peer and send its outcome; whatever it prints is lost."""
    try:
        with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
            for count in (WARM_UP, elements):
                case = CASES[problem]()
                outcome = PEERS[name](case, numbers(case, count, radau(3)))
    except Exception as error:  # a peer may fail in any way; the row says how
        outcome = Outcome(note=f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"[:70])
    answer.send(outcome)
    answer.close()


def rockit(case: Case, given: Numbers) -> Outcome:
    """Run rockit: direct collocation, Radau of degree 3, one constant control on each element."""
    import rockit as tool

    cpu, begun = time.process_time(), time.perf_counter()
    system, n = case.system, len(given.u)
    rate = ca.Function("rate", [system.x, system.u], [system.rate, case.running])
    stage = tool.Ocp(T=tool.FreeTime(given.duration) if case.free else case.duration)
    x, u = stage.state(system.x.numel(), scale=given.x_scale), stage.control(system.u.numel(), scale=given.u_scale)
    derivative, running = rate(x, u)
    stage.set_der(x, derivative)
    stage.add_objective(stage.T if case.free else stage.integral(running))
    for pins, at in ((case.start, stage.at_t0), (case.end, stage.at_tf)):
        for expression, values in pins:
            pinned = ca.Function("pin", [system.x], [expression])
            stage.subject_to(at(pinned(x)) == ca.DM(list(values)))
    for signal, (low, high) in ((x, case.x), (u, case.u)):
        for i in np.flatnonzero(np.isfinite(low) & np.isfinite(high)):
            grid = {"grid": "integrator_roots"} if signal is x else {}
            stage.subject_to((float(low[i]) <= (signal[int(i)] <= float(high[i]))), **grid)
    stage.set_initial(x, given.x[:, 0].T)
    stage.set_initial(u, given.u.T)
    stage.solver("ipopt", {"ipopt": {"tol": TOLERANCE, "print_level": 0, "sb": "yes"}, "print_time": False})
    stage.method(tool.DirectCollocation(N=n, M=1, degree=3, scheme="radau"))
    stage._transcribe()
    started = time.perf_counter()
    solution = stage.solve()
    spent = time.perf_counter() - started
    stats = solution.stats
    inside = sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_"))
    cost = float(solution.value(stage.objective))
    return Outcome(
        started - begun, inside, spent - inside, time.process_time() - cpu, float(stats["iter_count"]), cost,
        note="" if stats["success"] else str(stats["return_status"]),
    )  # fmt: skip


PEERS: dict[str, Peer] = {"rockit": rockit}
MODULES = {"rockit": ("rockit",)}
