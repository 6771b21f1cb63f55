"""The contract of NLP solvers: another solver than IPOPT is one small file."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Fixed, Ipopt, Problem, Status, System, along, end, multistart, solve, start, uniform
from ocp.checks import Array
from ocp.solving.nlp_solver import NlpResult, NlpSettings, NlpSolver, Start
from ocp.transcription.scaled_nlp import Bounds, ScaledNlp


@dataclass(frozen=True)
class Sqp:
    """Sequential quadratic programming of CasADi: a back-end as a user would write it."""

    tol: float = 1e-9
    max_iter: int = 50
    max_seconds: float = 60.0
    scaled: bool = True

    def make(self, nlp: ScaledNlp, start: Start) -> NlpSolver:
        quiet = {"print_time": False, "print_header": False, "print_iteration": False, "print_status": False}
        qp = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
        options = {
            **quiet, "qpsol": "qrqp", "qpsol_options": qp, "max_iter": self.max_iter, "tol_pr": self.tol,
            "tol_du": self.tol, "error_on_fail": False,
        }  # fmt: skip
        function = ca.nlpsol("sqp", "sqpmethod", dict(nlp.expressions), options)

        def solver(z0: Array, s: Array, bounds: Bounds, multipliers: tuple[Array, Array] | None = None) -> NlpResult:
            begun = time.perf_counter()
            low, high, rows_low, rows_high = bounds
            result = function(x0=z0, p=s, lbx=low, ubx=high, lbg=rows_low, ubg=rows_high)
            stats = function.stats()
            status = Status.SOLVED if stats["success"] else Status.FAILED
            z, rows, limits = (np.array(result[name]).ravel() for name in ("x", "lam_g", "lam_x"))
            seconds = time.perf_counter() - begun
            count = int(stats["iter_count"])
            return NlpResult(
                z, rows, limits, float(result["f"]), status, str(stats["return_status"]), count, 0.0, seconds, {}
            )

        return solver


def least_effort(units: float = 1.0) -> Problem:
    """Return the rest-to-rest motion of a mass in 1 s with least integral of u^2: 12 units^2."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u))
    ends = (start(x, 0.0), end(x, [units, 0.0]), along(u, -50.0 * units, 50.0 * units))
    return Problem(system, Fixed(1.0), Bolza(running=u**2), ends)


@pytest.mark.parametrize("units", [1.0, 1e3])
def test_another_solver_finds_the_same_motion_and_multipliers(units: float) -> None:
    ours = solve(least_effort(units), grid=uniform(10))
    theirs = solve(least_effort(units), grid=uniform(10), solver=Sqp())
    assert theirs.ok, theirs.message
    assert theirs.cost == pytest.approx(ours.cost, rel=1e-8)
    t = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(theirs.u(t), ours.u(t), atol=1e-6 * units)
    # Costates come from the multipliers of the rows, which are converted to physical units.
    scale = float(np.max(np.abs(ours.costate(t))))
    np.testing.assert_allclose(theirs.costate(t), ours.costate(t), atol=1e-6 * scale)


def test_both_follow_the_contract() -> None:
    assert isinstance(Ipopt(), NlpSettings)
    assert isinstance(Sqp(), NlpSettings)
    assert replace(Sqp(), tol=1e-6).tol == 1e-6


def test_starts_are_solved_by_any_solver() -> None:
    optima = multistart(least_effort(), 2, grid=uniform(8), solver=Sqp())
    assert optima[0].hits == 2


@pytest.mark.parametrize("wrong", [Sqp, "ipopt", 1e-9, {"tol": 1e-9}])
def test_what_is_no_settings_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError, match=r"solver: got .*, expected settings of the solver"):
        solve(least_effort(), grid=uniform(8), solver=wrong)  # type: ignore[arg-type]


def test_a_solve_that_ends_before_its_first_iteration_counts_none() -> None:
    """IPOPT leaves its own count unset then; it printed 538976266."""
    problem = least_effort()
    x, u = problem.system.x, problem.system.u
    crossing = replace(problem, subject_to=(*problem.subject_to, along(1.0 / (u[0] - 1.0), -1e6, 1e6)))
    for one in (solve(problem, grid=uniform(4), solver=Ipopt(extra={"max_wall_time": 1e-9})), solve(crossing)):
        assert 0 <= one.iterations <= 500
    nothing_left = tuple(end(x, [0.1 * k, 0.0]) for k in range(3))
    assert solve(replace(problem, subject_to=nothing_left), grid=uniform(4)).iterations == 0
