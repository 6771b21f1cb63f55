"""Failed solves explain themselves: no traceback, no bare IPOPT status, and the docs print what is said."""

from __future__ import annotations

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from failing import DRIVES, FAILING, FROM, GRID, TO, WITHIN, Failing, arm

from ocp import Ipopt, Problem, Status, System, along, end, point_to_point, solve, start

DOCUMENT = Path(__file__).parent.parent / "docs" / "failures.md"


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
