"""Grids that resolve a motion: dry friction where a velocity reverses."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Free, Ipopt, Problem, Sequence, System, along, end, resolved, solve, start, uniform, verify

FRICTION, WIDTH = 0.3, 1e-3
QUIET = Ipopt(progress=False)
# The mass arrives with velocity -1: it brakes with u + friction, comes back to x = 1 with u - friction, brakes again.
BACK = 1.0 / (2.0 * (1.0 + FRICTION))
PEAK = np.sqrt(2.0 * (1.0 + BACK) / (1.0 / (1.0 - FRICTION) + 1.0 / (1.0 + FRICTION)))
EXACT = 1.0 / (1.0 + FRICTION) + PEAK / (1.0 - FRICTION) + PEAK / (1.0 + FRICTION)


def returning(width=WIDTH):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, rate=ca.vertcat(x[1], u - FRICTION * ca.tanh(x[1] / width)))
    limits = start(x, [0.0, -1.0]), end(x, [1.0, 0.0]), along(u, -1.0, 1.0)
    return Problem(system, Free(2.0), Bolza(time=1.0), limits)


@pytest.mark.slow
def test_a_reversal_with_dry_friction_is_resolved_by_default():
    given = solve(returning(), grid=uniform(50), solver=QUIET)
    assert len(given.grid) == 50
    assert "resolved(solution)" in given.message
    assert not verify(given).ok
    default = solve(returning(), solver=QUIET)
    assert 50 < len(default.grid) < 150
    assert verify(default).ok, verify(default)
    assert "elements instead of 50" in default.message
    # The smoothed friction is weaker within its width only.
    assert default.duration == pytest.approx(EXACT, abs=4e-3)


def test_a_motion_that_the_grid_resolves_comes_back_as_it_is():
    found = solve(returning(width=1.0), grid=uniform(50), solver=QUIET)
    assert resolved(found, QUIET) is found


def test_seconds_bound_it():
    coarse = solve(returning(), grid=uniform(50), solver=QUIET)
    assert resolved(coarse, QUIET, seconds=1e-9) is coarse
    with pytest.raises(ValueError, match="seconds"):
        resolved(coarse, QUIET, seconds=-1.0)


@pytest.mark.slow
def test_phases_are_resolved_together():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, rate=ca.vertcat(x[1], u - FRICTION * ca.tanh(x[1] / WIDTH)))
    fastest = Bolza(time=1.0)
    out = Problem(system, Free(1.0), fastest, (start(x, [0.0, -1.0]), end(x[1], 0.2), along(u, -1.0, 1.0)))
    back = Problem(system, Free(2.0), fastest, (end(x, [1.0, 0.0]), along(u, -1.0, 1.0)))
    both = Sequence([out, back], [(x, x)])
    coarse, found = solve(both, grid=uniform(40), solver=QUIET), solve(both, solver=QUIET)
    assert not verify(coarse).ok
    assert verify(found).ok, verify(found)
    assert found.duration == pytest.approx(EXACT, abs=4e-3)
