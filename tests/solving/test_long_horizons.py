"""Horizons much longer than a state takes to fall back: what controls could cause in them is no scale of its errors."""

import casadi as ca
import pytest
from catalogue.published import hypersensitive_value

from ocp import Bolza, Fixed, Problem, System, end, estimate, solve, start, uniform, verify


def hypersensitive(duration):
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    cost = Bolza(running=(x**2 + u**2) / 2.0)
    return Problem(System(x, u, rate=u - x**3), Fixed(duration), cost, (start(x, 1.5), end(x, 1.0)))


@pytest.mark.slow
@pytest.mark.parametrize("duration", [1e3, 1e4])
def test_boundary_layers_of_a_long_horizon(duration):
    # The drift was compared with u_max T: at 1e4 s a cost of 1e9 was called verified.
    solution = solve(hypersensitive(duration))
    error = solution.cost - hypersensitive_value()
    assert 0.0 < error < 0.02
    assert error <= 3.0 * estimate(solution).cost
    assert verify(solution).ok == (duration < 5e3)


def test_a_motion_that_no_control_causes_is_not_verified():
    coarse = solve(hypersensitive(1e4), grid=uniform(20))
    assert not verify(coarse).ok
