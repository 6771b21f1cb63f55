"""Kinks: found in the graph, named when a solve fails, and avoided exactly by a further control."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from models import spherical
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Bolza,
    CoarseGrid,
    Control,
    Fixed,
    Ipopt,
    Problem,
    Status,
    System,
    absolute,
    along,
    end,
    point_to_point,
    positive_part,
    radau,
    solve,
    start,
    uniform,
    verify,
)
from ocp.problem.nonsmooth import kinks

x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
MASS = System(x, u, None, ca.vertcat(x[1], u), {"tau": u, "power": u * x[1]})
ENDS = (start(x, 0.0), end(x, [1.0, 0.0]), along(u, -1.0, 1.0))


def test_least_fuel_of_a_mass():
    """min int |u| over 1 from rest to rest in 2.5 s with |u| <= 1: push for 0.5 s, coast, brake; exactly 1.0."""
    system, s = absolute(MASS, u)
    solution = solve(Problem(system, Fixed(2.5), Bolza(running=s), ENDS), grid=uniform(50))
    assert solution.ok, solution.message
    assert solution.cost == pytest.approx(1.0, rel=1e-8)
    assert verify(solution).ok
    direct = Problem(MASS, Fixed(2.5), Bolza(running=ca.fabs(u)), ENDS)
    assert kinks(direct) == [("the running cost", "fabs")]


@pytest.mark.parametrize("control", [Control.LINEAR, Control.COLLOCATED])
def test_least_energy_without_recovery(control):
    """min int max(u v, 0), from rest to rest over 1 in 2.5 s: braking is free, so the energy is v^2 / 2 of coasting.

    With |u| <= 1 the slowest coasting speed is 0.5: 0.125 J.
    """
    system, s = positive_part(MASS, MASS["power"], name="motor")
    solution = solve(Problem(system, Fixed(2.5), Bolza(running=s), ENDS), radau(3, control), uniform(50))
    assert solution.ok, solution.message
    assert solution.cost == pytest.approx(0.125, rel=2e-2)
    t = np.linspace(0.0, 2.5, 2001)
    power = solution.signal("power", t)[:, 0]
    # The limits hold at the points of an element; between them both are smooth, and differ where the control jumps.
    assert np.all(solution.signal("motor", t)[:, 0] >= np.maximum(power, 0.0) - 2e-2)


@pytest.mark.slow
def test_motor_energy_of_an_arm_is_that_of_its_powers():
    """The cost with a slack for every drive is the integral of the positive powers, and below that of least torque."""
    arm = canonical(spherical(), [Gravity()])
    power = arm["tau"] * arm["v"]
    system, s = positive_part(arm, power, name="motor")
    fixed = {"q": ([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]), "tau": [400.0, 250.0, 60.0, 300.0]}
    ends = [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9]
    # Slack and power are equal at points only: on 30 elements the cost is 2.5 % from the integral, on 60 it is 0.7 %.
    scheme, grid = radau(3, Control.LINEAR), uniform(60)
    cheap = point_to_point(system, *ends, minimise=Bolza(running=ca.sum1(s)), horizon=Fixed(1.2), **fixed)
    # By itself `solve` comes to the coarse grid as its third guess, unless the machine is too busy for that.
    solution = solve(cheap, scheme, grid, guess=(CoarseGrid(),))
    assert solution.ok, solution.message
    effort = Bolza(running=ca.sumsqr(arm["tau"] / ca.DM(fixed["tau"])))
    gentle = solve(point_to_point(arm, *ends, minimise=effort, horizon=Fixed(1.2), **fixed), scheme, grid)
    t = np.linspace(0.0, 1.2, 12001)
    energies = [float(np.trapezoid(np.maximum(one.signal(power, t), 0.0).sum(axis=1), t)) for one in (solution, gentle)]
    assert solution.cost == pytest.approx(energies[0], rel=2e-2)
    assert energies[0] < energies[1]


@pytest.mark.parametrize(("expression", "named"), [
    (ca.fabs(u), ["fabs"]), (ca.fmax(u, 0), ["fmax"]), (ca.fmin(x[0], u), ["fmin"]), (ca.sign(x[1]), ["sign"]),
    (ca.if_else(u > 0, u, 0), ["<", "if_else"]), (u**2 + ca.tanh(x[0]), []), (ca.fabs(ca.SX.sym("p")) * u, []),
    (ca.fabs(ca.SX(-3.0)) * u, []), (ca.sqrt(u**2 + 1.0), []),
])  # fmt: skip
def test_kinks_are_found_where_the_motion_meets_them(expression, named):
    p = [s for s in ca.symvar(expression) if s.name() == "p"]
    system = System(x, u, ca.vertcat(*p) if p else None, ca.vertcat(x[1], u), nominal={"p": 1.0} if p else {})
    found = kinks(Problem(system, Fixed(1.0), Bolza(running=expression), ENDS))
    assert [kink for _, kink in found if kink in named or not named] == named


def test_a_failed_solve_names_the_kink_and_the_way_out():
    shaken = Problem(MASS, Fixed(2.5), Bolza(running=ca.fabs(u) + ca.fmax(x[1] - 0.4, 0)), ENDS)
    solution = solve(shaken, grid=uniform(50), solver=Ipopt(max_iter=30))
    assert solution.status is not Status.SOLVED
    assert "the running cost (fabs), the running cost (fmax)" in solution.message
    assert "ocp.absolute and ocp.positive_part" in solution.message


def test_names_and_symbols_are_checked():
    system, _ = absolute(MASS, ca.vertcat(u, x[1]), name="size")
    assert [str(label) for label in system.label("u", 3)] == ["u", "size_1", "size_2"]
    assert set(system.limits) == {"size - e", "size + e"}
    again, _ = positive_part(system, u)
    assert again.u.numel() == 4
    with pytest.raises(ValueError, match="the signals of the system do not have"):
        absolute(system, u, name="size")
    with pytest.raises(ValueError, match="symbols that are not in x, u or p"):
        positive_part(MASS, ca.SX.sym("z"))
    with pytest.raises(TypeError, match="absolute"):
        absolute(MASS, 1.0)
