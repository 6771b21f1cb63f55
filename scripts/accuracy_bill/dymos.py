"""Dymos with its own grid refinement on a problem of the benchmark, in a process of its own.

Radau of degree 3 with collocated controls, IPOPT by pyOptSparse (no Hessian, as Dymos offers none), unknowns scaled,
our guess and tolerance. After every pass a line of JSON is printed: seconds so far, cost, elements, highest degree.
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
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np
from benchmarks.peers import environment
from benchmarks.problems import CASES, Case, Pin, numbers

from accuracy_bill.contenders import Contender, Run
from accuracy_bill.scene import Scene
from ocp import Ipopt
from ocp.checks import Array

MODULES = ("dymos", "openmdao", "pyoptsparse", "cyipopt")
ELEMENTS, PASSES, TOLERANCE = 12, 12, 1e-9


def missing() -> str:
    """Return why Dymos cannot run, or an empty string."""
    absent = [name for name in MODULES if not importlib.util.find_spec(name)]
    return f"not installed: {', '.join(absent)}" if absent else ""


def of_dymos(method: str, limit: float) -> Contender:
    """Return Dymos with refinement "hp" or "ph", stopped after `limit` seconds; every pass is a run."""

    def runs(scene: Scene) -> Iterator[Run]:
        if missing() or not scene.peer or not CASES[scene.peer]().free:
            return
        command = [sys.executable, "-m", "accuracy_bill.dymos", scene.peer, method]
        try:
            printed = subprocess.run(command, capture_output=True, timeout=limit, check=False, env=environment()).stdout
        except subprocess.TimeoutExpired as late:
            printed = late.stdout or b""
        passes = [json.loads(line) for line in printed.decode().splitlines() if line.startswith('{"seconds"')]
        for k, result in enumerate(passes):
            label = f"pass {k}, {result['elements']} elements, degree {result['degree']}"
            note = "" if result["solved"] else "the solver failed"
            yield Run(
                label, result["cost"], result["setup"], float("nan"), result["seconds"] - result["setup"], note=note
            )

    return Contender(f"dymos, {method} refinement", runs)


def main(name: str, method: str) -> None:
    """Solve a problem pass by pass; print a line for each."""
    warnings.simplefilter("ignore")
    os.environ["OPENMDAO_REPORTS"] = "0"
    dymos = importlib.import_module("dymos")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        begun = time.perf_counter()
        problem = build(CASES[name](), dymos)
        setup, once = time.perf_counter() - begun, problem.run_driver
        phase = problem.model.traj.phases.phase

        def reported(*args: Any, **named: Any) -> Any:
            result = once(*args, **named)
            grid = phase.options["transcription"].options
            account = {
                "seconds": time.perf_counter() - begun, "setup": setup,
                "cost": float(problem.get_val("traj.phase.timeseries.time")[-1, 0]),
                "elements": int(grid["num_segments"]), "degree": int(np.max(grid["order"])),
                "solved": bool(getattr(result, "success", not result)),
            }  # fmt: skip
            print(f"\n{json.dumps(account)}", flush=True)
            return result

        problem.run_driver = reported
        dymos.run_problem(problem, refine_method=method, refine_iteration_limit=PASSES)


def build(case: Case, dymos: Any) -> Any:
    """Return the OpenMDAO problem of a case in minimum time whose pins fix the whole state at both ends."""
    om = importlib.import_module("openmdao.api")
    system, given = case.system, numbers(case, ELEMENTS, Ipopt())
    nx, nu = system.x.numel(), system.u.numel()
    problem = om.Problem(model=om.Group())
    problem.driver = om.pyOptSparseDriver(optimizer="IPOPT", print_results=False)
    problem.driver.declare_coloring(show_summary=False)
    ipopt = {"tol": TOLERANCE, "print_level": 0, "max_iter": 1000, "bound_relax_factor": 0.0}
    problem.driver.opt_settings.update(ipopt)
    trajectory = problem.model.add_subsystem("traj", dymos.Trajectory())
    method = dymos.Radau(num_segments=ELEMENTS, order=3)
    phase = trajectory.add_phase("phase", dymos.Phase(ode_class=_component(case, om), transcription=method))
    phase.set_time_options(fix_initial=True, duration_bounds=(1e-3 * given.duration, 1e3 * given.duration))
    for i in range(nx):
        sides = {k: float(side[i]) for k, side in zip(("lower", "upper"), case.x, strict=True) if np.isfinite(side[i])}
        scale = float(given.x_scale[i])
        phase.add_state(
            f"x{i}", fix_initial=True, fix_final=True, rate_source=f"rate{i}", targets=[f"x{i}"], ref=scale, **sides
        )
    for i in range(nu):
        low, high = float(case.u[0][i]), float(case.u[1][i])
        phase.add_control(
            f"u{i}", opt=True, lower=low, upper=high, ref=float(given.u_scale[i]), targets=[f"u{i}"],
            continuity=False, rate_continuity=False,
        )  # fmt: skip
        phase.add_path_constraint(f"u{i}", lower=low, upper=high, ref=float(given.u_scale[i]))
    phase.add_objective("time", ref=given.duration)
    phase.set_refine_options(refine=True, tol=1e-8, max_order=12, smoothness_factor=1.2)
    problem.setup()
    times, guess = given.guess.share * given.duration, given.guess
    path = guess.x.copy()  # Dymos fixes the ends at what the guess is there, to the last digit
    path[0], path[-1] = (_pinned(case, pins, path[k]) for k, pins in ((0, case.start), (-1, case.end)))
    phase.set_time_val(initial=0.0, duration=given.duration)
    for i in range(nx):
        phase.set_state_val(f"x{i}", vals=path[:, i], time_vals=times)
    for i in range(nu):
        phase.set_control_val(f"u{i}", vals=guess.u[:, i], time_vals=times)
    return problem


def _pinned(case: Case, pins: Sequence[Pin], near: Array) -> Array:
    """Return the state that meets all pins, by Newton's method."""
    x = case.system.x
    left = ca.vertcat(*(expression - ca.DM(list(values)) for expression, values in pins))
    newton = ca.Function("newton", [x], [x - ca.solve(ca.jacobian(left, x), left)])
    for _ in range(8):
        near = np.array(newton(near)).ravel()
    return near


def _component(case: Case, om: Any) -> Any:
    """Return the class of the component rate(x, u), with exact derivatives from CasADi."""
    system = case.system
    names = [f"x{i}" for i in range(system.x.numel())] + [f"u{i}" for i in range(system.u.numel())]
    slope = ca.jacobian(system.rate, ca.vertcat(system.x, system.u))
    rows, columns = slope.sparsity().get_triplet()
    rate = ca.Function("rate", [system.x, system.u], [ca.densify(system.rate)])
    entries = ca.Function("entries", [system.x, system.u], [slope[slope.sparsity().find()]])

    class Rate(om.ExplicitComponent):  # type: ignore[misc]
        """x' = f(x, u) at all nodes."""

        def initialize(self) -> None:
            self.options.declare("num_nodes", types=int)

        def setup(self) -> None:
            n = self.options["num_nodes"]
            for name in names:
                self.add_input(name, val=np.ones(n))
            for i in range(system.x.numel()):
                self.add_output(f"rate{i}", val=np.ones(n), units="1/s")
            for i, j in zip(rows, columns, strict=True):
                self.declare_partials(f"rate{i}", names[j], rows=np.arange(n), cols=np.arange(n))

        def _at(self, function: ca.Function, inputs: Any) -> Any:
            values, n = np.array([inputs[name] for name in names]), self.options["num_nodes"]
            nx = system.x.numel()
            return np.array(function.map(n)(values[:nx], values[nx:]))

        def compute(self, inputs: Any, outputs: Any) -> None:
            for i, values in enumerate(self._at(rate, inputs)):
                outputs[f"rate{i}"] = values

        def compute_partials(self, inputs: Any, partials: Any) -> None:
            for k, values in enumerate(self._at(entries, inputs)):
                partials[f"rate{rows[k]}", names[columns[k]]] = values

    return Rate


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
