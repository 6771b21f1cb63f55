"""Equations along the motion for all shapes of the control, against the same problem stated without them."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Control,
    Fixed,
    Problem,
    System,
    along,
    end,
    legendre,
    lobatto,
    polish,
    prepare,
    radau,
    solve,
    start,
    uniform,
    verify,
)

x, u, v, NONE = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("v"), ca.SX(0, 1)
FAMILIES = (radau, legendre, lobatto)
# Errors of the cost at 20 elements: with constant controls of second order, with the others of fourth and more.
MIXED = {Control.CONSTANT: 1e-3, Control.LINEAR: 1e-3, Control.SEGMENTS: 1e-3, Control.COLLOCATED: 1e-12}


def mixed() -> Problem:
    """Return min int x^2 + u^2 + v^2 with x' = u, x(0) = 1 and u + v = x."""
    system = System(x, ca.vertcat(u, v), NONE, u)
    return Problem(system, Fixed(1.0), Bolza(running=x**2 + u**2 + v**2), (start(x, 1.0), along(u + v - x, 0.0, 0.0)))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("control", list(Control))
def test_an_equation_of_state_and_controls(family, control):
    """With v = x - u it is an LQ problem: cost K(0), -K' = 2 - (K - 1)^2 / 2, K(1) = 0."""
    exact = 1.8449383769
    solution = solve(mixed(), family(3, control), uniform(20))
    assert solution.ok
    assert solution.iterations <= 3  # quadratic cost, linear equations
    assert solution.cost == pytest.approx(exact, rel=MIXED[control] if control is not Control.COLLOCATED else 2e-8)
    if control is Control.COLLOCATED:
        assert verify(solution).ok
    finer = solve(mixed(), family(3, control), uniform(40))
    if control is not Control.COLLOCATED:
        assert abs(finer.cost - exact) < 0.3 * abs(solution.cost - exact)  # second order


def pendulum(equation: bool) -> Problem:
    """Return the least-effort swing of a pendulum to 1 rad, in Cartesian coordinates (index 3) or in the angle."""
    if not equation:
        angle, rate = ca.SX.sym("angle"), ca.SX.sym("rate")
        system = System(ca.vertcat(angle, rate), u, NONE, ca.vertcat(rate, u - ca.sin(angle)))
        ends = (start(system.x, 0.0), end(system.x, [1.0, 0.0]))
        return Problem(system, Fixed(2.0), Bolza(running=u**2), ends)
    q, w = ca.SX.sym("q", 2), ca.SX.sym("w", 2)
    push = u * ca.vertcat(-q[1], q[0]) - v * q - ca.vertcat(0.0, 1.0)
    system = System(ca.vertcat(q, w), ca.vertcat(v, u), NONE, ca.vertcat(w, push))
    return Problem(system, Fixed(2.0), Bolza(running=u**2), (
        start(q, [0.0, -1.0]), start(w, 0.0), end(q[0], np.sin(1.0)), end(q[1], -1.0, 0.0), end(w, 0.0),
        along(ca.sumsqr(q), 1.0, 1.0, name="length"),
    ))  # fmt: skip


@pytest.mark.parametrize(("control", "error", "open_by"), [
    (Control.CONSTANT, 2e-3, 1e-3), (Control.LINEAR, 1e-5, 2e-5), (Control.COLLOCATED, 1e-7, 2e-6),
])  # fmt: skip
def test_an_equation_of_the_position_alone(control, error, open_by):
    exact = solve(pendulum(False), radau(5, Control.COLLOCATED), uniform(40)).cost
    solution = solve(pendulum(True), radau(3, control), uniform(20))
    assert solution.ok
    assert solution.cost == pytest.approx(exact, rel=error)
    q = solution.x(np.linspace(0.0, 2.0, 101))[:, :2]
    assert np.max(np.abs(np.sum(q**2, axis=1) - 1.0)) < open_by


def test_an_equation_may_have_another_value_and_free_ends():
    """x1 + x2 = 3 on a plane where each coordinate has its own control: least effort goes along the line."""
    q, w = ca.SX.sym("q", 2), ca.SX.sym("w", 2)
    problem = Problem(System(q, w, NONE, w), Fixed(1.0), Bolza(running=ca.sumsqr(w)), (
        start(q[0], 0.0), end(q[0], 1.0), along(q[0] + q[1], 3.0, 3.0)))  # fmt: skip
    for control in Control:
        solution = solve(problem, radau(3, control), uniform(8))
        assert solution.cost == pytest.approx(2.0, rel=1e-8)
        np.testing.assert_allclose(solution.x(np.array([0.0, 0.5, 1.0]))[:, 1], [3.0, 2.5, 2.0], atol=1e-7)
        assert verify(solution).violation < 1e-8


def test_a_prepared_equation_keeps_its_value():
    prepared = prepare(mixed(), grid=uniform(5))
    other = replace(mixed(), system=prepared.problem.system)
    with pytest.raises(ValueError, match="differs from the prepared one"):
        prepared(problem=replace(prepared.problem, subject_to=(start(x, 1.0), along(u + v - x, 0.5, 0.5))))
    assert prepared(problem=replace(prepared.problem, subject_to=(start(x, 2.0), other.subject_to[1]))).ok


def test_polish_of_a_problem_with_an_equation_answers():
    polished = polish(solve(mixed(), radau(3, Control.COLLOCATED), uniform(10)))
    assert polished.cost == pytest.approx(1.8449383769, rel=1e-6)
