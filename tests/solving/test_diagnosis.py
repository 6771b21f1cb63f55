"""Failed solves explain themselves: no traceback, no bare IPOPT status, and the docs print what is said."""

from __future__ import annotations

import os
import pickle
import re
import signal
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.failing import DRIVES, FAILING, FROM, GRID, TO, WITHIN, Failing, arm

from ocp import (
    Bolza,
    Control,
    Fixed,
    Ipopt,
    Problem,
    Solution,
    Status,
    System,
    along,
    end,
    gentle,
    lobatto,
    point_to_point,
    prepare,
    radau,
    solve,
    start,
    uniform,
    verify,
)
from ocp.solution.integration_drift import drift
from ocp.solving import diagnosis, iteration_watch

DOCUMENT = Path(__file__).parents[2] / "docs" / "failures.md"


@pytest.mark.parametrize("case", FAILING, ids=lambda case: case.name)
def test_a_failing_problem_says_what_is_wrong(case: Failing) -> None:
    solution = case.run()
    for words in case.says:
        assert words in solution.message, solution.message
    assert re.search(r"[a-z]{3,} [a-z]{2,} [a-z]{2,}", solution.message)
    assert solution.solver_status not in solution.message
    assert np.all(np.isfinite(solution.states))
    printed = DOCUMENT.read_text(encoding="utf-8")
    section = " ".join(printed.split(f"## {case.name}\n", 1)[1].split("\n## ", 1)[0].replace("\n> ", " ").split())
    # Figures of an iterate that did not converge may differ in the last digits from machine to machine.
    for words in case.says:
        assert words in section
    assert solution.status.name in section


def test_a_weak_drive_that_still_finds_a_way_is_reported_as_such() -> None:
    system = arm()
    solution = solve(point_to_point(system, FROM, TO, q=WITHIN, tau=[140.0, 160.0, 3.0, 400.0]), grid=GRID)
    assert solution.ok
    assert "tau_theta cannot hold the end" in solution.message
    held = (40.0 * 0.15 + 15.0 * 0.9) * 9.81 * np.sin(1.6)
    assert f"{-held:.1f} N m are needed" in solution.message


def test_the_time_limit_keeps_the_last_iterate() -> None:
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    solution = solve(task, grid=GRID, guess=None, solver=Ipopt(max_iter=3))
    assert solution.status is Status.LIMIT
    assert "max_iter" in solution.message
    assert np.all(np.isfinite(solution.states))
    assert solution.solver_status == "Maximum_Iterations_Exceeded"
    assert len(solution.log["inf_pr"]) == 4


def test_nan_is_traced_to_the_limited_expression() -> None:
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), u, {"q": x}, {})
    task = Problem(
        system, subject_to=(start(x, 0.0), end(x, 1.0), along(u, -1, 1), along(ca.log(x - 2.0), -5, 5, name="log"))
    )
    solution = solve(task, grid=GRID)
    assert solution.status in (Status.FAILED, Status.INFEASIBLE)
    assert "log" in solution.message


def test_an_option_that_ipopt_does_not_know_is_named() -> None:
    task = point_to_point(arm(), FROM, TO, tau=DRIVES)
    with pytest.raises(ValueError, match="no_such_option"):
        solve(task, grid=GRID, solver=Ipopt(extra={"no_such_option": 1}))


def test_a_duration_below_the_speed_limit_is_found_before_solving() -> None:
    system = arm()
    slow = point_to_point(system, FROM, TO, tau=DRIVES, v=[2.0, 2.0, 9.0, 2.0], horizon=Fixed(0.9))
    solution = solve(slow, grid=GRID)
    assert solution.status is Status.INFEASIBLE
    assert solution.solver_status == "not started"
    assert "psi has 2 rad to go, which takes at least 1 s at its limit of 2 rad/s" in solution.message
    assert solve(replace(slow, horizon=Fixed(1.2)), grid=GRID).ok


def test_ctrl_c_returns_the_last_iterate(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate = iteration_watch.Watch.eval_buffer

    def pressed_in_the_third_iteration(
        watch: iteration_watch.Watch, arg: list[memoryview], res: list[memoryview]
    ) -> int:
        if watch.count == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return evaluate(watch, arg, res)

    monkeypatch.setattr(iteration_watch.Watch, "eval_buffer", pressed_in_the_third_iteration)
    prepared = prepare(point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES), grid=uniform(50))
    before = signal.getsignal(signal.SIGINT)
    solution = prepared()
    assert solution.status is Status.STOPPED
    assert solution.solver_status == "User_Requested_Stop"
    assert np.all(np.isfinite(solution.states))
    assert solution.iterations > 0
    assert signal.getsignal(signal.SIGINT) is before


def test_a_collocated_control_beyond_its_limits_is_told() -> None:
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    loose = solve(task, radau(3, Control.COLLOCATED), GRID)
    assert loose.ok
    assert "leaves its limits between the collocation points by" in loose.message
    for control in (Control.CONSTANT, Control.LINEAR):
        assert "between" not in solve(task, radau(3, control), GRID).message


def test_progress_on_a_long_solve(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(iteration_watch, "QUIET_SECONDS", -1.0)
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    assert solve(task, grid=uniform(300), solver=Ipopt(progress=True)).ok
    printed = capsys.readouterr().err
    assert re.search(r"iteration \d+, cost [\d.]+, infeasibility \d\.\de[-+]\d+, \d+ s", printed)
    assert solve(task, grid=GRID, solver=Ipopt(progress=False)).ok
    assert capsys.readouterr().err == ""


def test_ends_are_judged_with_the_values_of_the_solve() -> None:
    """A limit that depends on a parameter excludes the end for its nominal value only."""
    x, u, reach = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("reach")
    system = System(x, u, reach, u, {"x": x, "u": u}, {"reach": 1.0})
    task = Problem(system, subject_to=(start(x, 0.0), end(x, 2.0), along(u, -1, 1), along(x / reach, upper=1.0)))
    prepared = prepare(task, grid=GRID)
    refused = prepared()
    assert refused.status is Status.INFEASIBLE
    assert refused.solver_status == "not started"
    assert prepared(values={"reach": 2.5}).duration == pytest.approx(2.0, rel=1e-6)
    # As an unknown the parameter may grow until the end is inside.
    free = replace(task, subject_to=(*task.subject_to, along(reach, 0.5, 3.0)))
    found = solve(free, grid=GRID)
    assert found.ok
    assert found.duration == pytest.approx(2.0, rel=1e-6)
    assert found.free["reach"] >= 2.0 - 1e-6


def test_a_grid_that_does_not_resolve_the_motion_is_told_with_its_drift() -> None:
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    upright = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], 20.0 * ca.sin(x[0]) + u))
    task = Problem(upright, Fixed(1.5), Bolza(running=u**2), (start(x, [0.5, 0.0]), end(x, [0.0, 0.0])))
    coarse, fine = (solve(task, scheme, uniform(n)) for scheme, n in ((lobatto(2), 10), (radau(5), 100)))
    assert coarse.ok
    assert fine.ok
    assert "the grid does not resolve the motion" in coarse.message
    assert "solve_to_accuracy" in coarse.message
    assert verify(coarse).drift > 1e-3
    assert fine.message == Status.SOLVED.value
    assert verify(fine).drift < 1e-6


def test_the_motion_is_integrated_again_only_for_those_who_read_the_message(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[float] = []

    def counted(solution: Solution, *others: object) -> np.ndarray:
        calls.append(solution.cost)
        return drift(solution, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(diagnosis, "drift", counted)
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    solution, other = (solve(task, scheme, GRID) for scheme in (lobatto(2), lobatto(3)))
    assert calls == []
    travelled = pickle.loads(pickle.dumps(solution))
    assert calls == [solution.cost]
    assert travelled.message == solution.message == solution.message
    assert "does not resolve" in solution.message
    assert calls == [solution.cost]
    assert replace(other, rung="named").message == other.message
    assert calls == [solution.cost, other.cost]


def test_the_drift_that_is_told_is_that_of_a_re_integration() -> None:
    system = arm()
    solution = solve(point_to_point(system, FROM, TO, q=WITHIN, tau=DRIVES), lobatto(2), uniform(100))
    printed = re.search(r"by about (\S+) of its largest value", solution.message)
    assert printed is not None
    largest = float(verify(solution).drift)
    assert 0.5 * largest < float(printed[1]) < 2.0 * largest


def test_many_iterations_lead_to_gentle() -> None:
    task = point_to_point(arm(), FROM, TO, q=WITHIN, tau=DRIVES)
    solution = solve(task, grid=GRID)
    (words,) = diagnosis.wandering(replace(solution, iterations=200))
    assert words.startswith("it took 200 iterations")
    assert "gentle(problem)" in words
    assert diagnosis.wandering(replace(solution, iterations=40)) == []
    assert diagnosis.wandering(replace(solution, iterations=200, problem=gentle(task))) == []
