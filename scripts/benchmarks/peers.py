"""Other tools on the problems of the benchmark, each used as in its manual, where they are installed.

rockit     Radau of degree 3, one constant control on each element, scaled unknowns: the same NLP as ours
pyomo.dae  the same scheme, physical units; its NL file is solved by the IPOPT of CasADi, and reading it is not counted
drake      DirectCollocation: Hermite-Simpson, controls linear between samples, scaled unknowns, SNOPT

Guess and tolerance are ours. Every run is a process of its own, bounded in time, after a small run that is not counted.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.problems import CASES, Case, Numbers, RunResult, numbers
from ocp import Ipopt
from ocp.checks import Array

Peer = Callable[[Case, Numbers], RunResult]
WARM_UP = 4  # elements of the run that is not counted
TOLERANCE = 1e-9

OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_POW: lambda a, b: a**b,
    ca.OP_CONSTPOW: lambda a, b: a**b,
}


def missing(name: str) -> str:
    """Return why a peer cannot run, or an empty string."""
    return "" if importlib.util.find_spec(MODULES[name]) else "not installed"


def environment() -> dict[str, str]:
    """Return the environment of a child process that imports from the same folders as this one."""
    folders = [str(Path(folder).resolve()) for folder in sys.path if folder]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(folders)}


def run(name: str, problem: str, elements: int, limit: float) -> RunResult:
    """Run a peer in a process of its own, for at most `limit` seconds."""
    command = [sys.executable, "-m", "benchmarks.peers", name, problem, str(elements)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit, check=False, text=True, env=environment())
    except subprocess.TimeoutExpired:
        return RunResult(note=f"stopped after {limit:g} s")
    printed = done.stdout.splitlines()
    if done.returncode or not printed:
        return RunResult(note=f"its process ended with {done.returncode}")
    return RunResult(**json.loads(printed[-1]))


def main(name: str, problem: str, elements: int) -> None:
    """Run one peer and print its result on a line of its own."""
    try:
        for count in (WARM_UP, elements):
            case = CASES[problem]()
            result = PEERS[name](case, numbers(case, count, Ipopt()))
    except Exception as error:  # a peer may fail in any way; the row shows how
        result = RunResult(note=f"{type(error).__name__}: {' '.join(str(error).split())}"[:60])
    print(f"\n{json.dumps(asdict(result))}")


def rockit(case: Case, given: Numbers) -> RunResult:
    """Run rockit."""
    tool = importlib.import_module("rockit")

    system, n = case.system, len(given.u)
    cpu, begun = time.process_time(), time.perf_counter()
    rate = ca.Function("rate", [system.x, system.u], [system.rate, case.running])
    stage = tool.Ocp(T=tool.FreeTime(given.duration) if case.free else case.duration)
    x = stage.state(system.x.numel(), scale=ca.DM(given.x_scale))
    u = stage.control(system.u.numel(), scale=ca.DM(given.u_scale))
    derivative, running = rate(x, u)
    stage.set_der(x, derivative)
    stage.add_objective(stage.T if case.free else stage.integral(running))
    for pins, at in ((case.start, stage.at_t0), (case.end, stage.at_tf)):
        for expression, values in pins:
            stage.subject_to(at(ca.Function("pin", [system.x], [expression])(x)) == ca.DM(list(values)))
    for signal, (low, high), where in ((x, case.x, {"grid": "integrator_roots"}), (u, case.u, {})):
        for i in map(int, np.flatnonzero(np.isfinite(low))):
            stage.subject_to((low[i] <= (signal[i] <= high[i])), **where)
    path = ca.interpolant("x", "linear", [given.guess.share], given.guess.x.ravel())
    stage.set_initial(x, path(stage.t / given.duration))
    stage.set_initial(u, given.u.T)
    stage.solver(
        "ipopt", {"ipopt": {"tol": TOLERANCE, "print_level": 0, "sb": "yes"}, "print_time": False, "record_time": True}
    )
    stage.method(tool.DirectCollocation(N=n, M=1, degree=3, scheme="radau"))
    solution = stage.solve()
    everything, stats = time.perf_counter() - begun, solution.stats
    inside, spent = _inside(stats), stats["t_wall_total"]
    return RunResult(
        everything - spent, inside, spent - inside, time.process_time() - cpu, stats["iter_count"],
        float(solution.value(stage.objective)),
    )  # fmt: skip


def pyomo(case: Case, given: Numbers) -> RunResult:
    """Run pyomo.dae on shares of the duration; the integral of the cost is one more state."""
    dae, tool = importlib.import_module("pyomo.dae"), importlib.import_module("pyomo.environ")

    system, n = case.system, len(given.u)
    cpu, begun = time.process_time(), time.perf_counter()
    nx, nu = system.x.numel(), system.u.numel()
    rate = ca.Function("rate", [system.x, system.u], [ca.densify(ca.vertcat(system.rate, case.running))])
    guess = given.guess
    model = tool.ConcreteModel()
    model.s = dae.ContinuousSet(bounds=(0.0, 1.0), initialize=np.linspace(0.0, 1.0, n + 1).tolist())
    model.T = tool.Var(initialize=given.duration, bounds=(0.0, None))
    if not case.free:
        model.T.fix()

    def limits(pair: tuple[Array, Array]) -> Callable[..., tuple[float | None, float | None]]:
        low, high = ([float(value) if np.isfinite(value) else None for value in side] for side in pair)
        return lambda _, s, i: (low[i], high[i])

    def start(values: Array) -> Callable[..., float]:
        return lambda _, s, i: float(np.interp(s, guess.share, values[:, i]))

    model.x = tool.Var(model.s, range(nx), bounds=limits(case.x), initialize=start(guess.x))
    model.u = tool.Var(model.s, range(nu), bounds=limits(case.u), initialize=start(guess.u))
    model.dx = dae.DerivativeVar(model.x, wrt=model.s)
    if not case.free:
        model.J = tool.Var(model.s, initialize=0.0)
        model.dJ = dae.DerivativeVar(model.J, wrt=model.s)
        model.J[0.0].fix(0.0)
    scheme = tool.TransformationFactory("dae.collocation")
    scheme.apply_to(model, nfe=n, ncp=3, scheme="LAGRANGE-RADAU")
    scheme.reduce_collocation_points(model, var=model.u, ncp=1, contset=model.s)
    model.rows = tool.ConstraintList()
    for s in list(model.s)[1:]:
        x, u = [model.x[s, i] for i in range(nx)], [model.u[s, i] for i in range(nu)]
        *derivative, running = replay(rate, [x, u], tool)
        for i, expression in enumerate(derivative):
            model.rows.add(model.dx[s, i] == model.T * expression)
        if not case.free:
            model.rows.add(model.dJ[s] == model.T * running)
    for pins, s in ((case.start, 0.0), (case.end, 1.0)):
        for expression, values in pins:
            pinned = ca.Function("pin", [system.x], [ca.densify(expression)])
            for left, value in zip(replay(pinned, [[model.x[s, i] for i in range(nx)]], tool), values, strict=True):
                model.rows.add(left == float(value))
    model.cost = tool.Objective(expr=model.T if case.free else model.J[1.0])
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "model.nl")
        model.write(path)
        started, cpu = time.perf_counter(), time.process_time() - cpu
        builder = ca.NlpBuilder()
        builder.import_nl(path, {"verbose": False})
    parts: dict[str, Any] = {"x": ca.vertcat(*builder.x), "f": builder.f, "g": ca.vertcat(*builder.g)}
    options: Any = {
        "ipopt": {"tol": TOLERANCE, "print_level": 0, "sb": "yes"},
        "print_time": False,
        "record_time": True,
        "expand": True,
    }
    solver = ca.nlpsol("solver", "ipopt", parts, options)
    resumed = time.process_time()
    result = solver(x0=builder.x_init, lbx=builder.x_lb, ubx=builder.x_ub, lbg=builder.g_lb, ubg=builder.g_ub)
    stats = solver.stats()
    inside, spent = _inside(stats), stats["t_wall_total"]
    return RunResult(
        started - begun, inside, spent - inside, cpu + time.process_time() - resumed, stats["iter_count"],
        float(result["f"]), note="" if stats["success"] else str(stats["return_status"]),
    )  # fmt: skip


def drake(case: Case, given: Numbers) -> RunResult:
    """Run Drake's DirectCollocation; it reports no seconds of derivatives, and SNOPT no iterations."""
    tool = importlib.import_module("pydrake.all")

    system, n = case.system, len(given.u)
    cpu, begun = time.process_time(), time.perf_counter()
    rate = ca.Function("rate", [system.x, system.u], [ca.densify(system.rate)])
    x = np.array([tool.Variable(f"x{i}") for i in range(system.x.numel())])
    u = np.array([tool.Variable(f"u{i}") for i in range(system.u.numel())])
    plant = tool.SymbolicVectorSystem(state=x, input=u, output=[], dynamics=replay(rate, [x, u], tool))
    step, loose = given.duration / n, (0.01, 100.0)
    method = tool.DirectCollocation(
        plant, plant.CreateDefaultContext(), n + 1, *(step * factor for factor in (loose if case.free else (1.0, 1.0)))
    )
    nlp = method.prog()
    method.AddEqualTimeIntervalsConstraints()
    for k in range(n + 1):
        for variables, (low, high), scale in (
            (method.state(k), case.x, given.x_scale), (method.input(k), case.u, given.u_scale),
        ):  # fmt: skip
            nlp.AddBoundingBoxConstraint(low, high, variables)
            for variable, size in zip(variables, scale, strict=True):
                nlp.SetVariableScaling(variable, size)
    for pins, ends in ((case.start, method.initial_state()), (case.end, method.final_state())):
        for expression, values in pins:
            pinned = ca.Function("pin", [system.x], [ca.densify(expression)])
            for left, value in zip(replay(pinned, [ends], tool), values, strict=True):
                nlp.AddConstraint(left, float(value), float(value))
    if case.free:
        method.AddFinalCost(method.time())
    else:
        cost = ca.Function("cost", [system.u], [case.running])
        method.AddRunningCost(replay(cost, [method.input()], tool)[0])
    times, hold = given.guess.share * given.duration, tool.PiecewisePolynomial.FirstOrderHold
    method.SetInitialTrajectory(hold(times, given.guess.u.T), hold(times, given.guess.x.T))
    started = time.perf_counter()
    result = tool.SnoptSolver().Solve(nlp)
    spent = time.perf_counter() - started
    note = "" if result.is_success() else str(result.get_solution_result()).split(".")[-1]
    return RunResult(
        started - begun, solver=spent, cpu=time.process_time() - cpu, cost=result.get_optimal_cost(), note=note
    )


def replay(function: ca.Function, arguments: Sequence[Sequence[Any] | Array], words: Any) -> list[Any]:
    """Return the first output of an SX function in the algebra of another tool, which `words` has sin, cos, ... of."""
    called = {ca.OP_SIN: words.sin, ca.OP_COS: words.cos, ca.OP_TAN: words.tan, ca.OP_SQRT: words.sqrt}
    operations = OPERATIONS | called
    work: dict[int, Any] = {}
    results: list[Any] = [0.0] * function.nnz_out(0)
    for k in range(function.n_instructions()):
        code, into, args = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_INPUT:
            work[into[0]] = arguments[args[0]][args[1]]
        elif code == ca.OP_CONST:
            work[into[0]] = function.instruction_constant(k)
        elif code == ca.OP_OUTPUT:
            results[into[1]] = work[args[0]]
        else:
            work[into[0]] = operations[code](*(work[i] for i in args))
    return results


def _inside(stats: dict[str, Any]) -> float:
    return float(sum(value for key, value in stats.items() if key.startswith("t_wall_nlp_")))


PEERS: dict[str, Peer] = {"rockit": rockit, "pyomo": pyomo, "drake": drake}
MODULES = {"rockit": "rockit", "pyomo": "pyomo", "drake": "pydrake"}

if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
