"""NLPs of problems of the same structure are made once, and are the same as those that are made anew."""

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Fixed, Free, Ipopt, Problem, System, along, end, radau, solve, start, uniform
from ocp.numerics.thread_cache import ThreadCache
from ocp.solving.prepared_nlp import forget_structures, prepare
from ocp.transcription.scaling import unscaled
from ocp.transcription.structure import structure_of

QUIET = Ipopt(progress=False)


def swing(goal=1.0, limit=2.0, drag=0.1, horizon=None, running=None, swapped=False):
    """Return a pendulum moved from rest to rest; every call makes new symbols."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, rate=ca.vertcat(x[1], u - ca.sin(x[0]) - drag * x[1]))
    cost = Bolza(time=1.0) if running is None else Bolza(running=running(x, u))
    fixed = end(x[::-1], [0.0, goal]) if swapped else end(x, [goal, 0.0])
    return Problem(system, horizon or Free(2.0), cost, (start(x, [0.0, 0.0]), fixed, along(u, -limit, limit)))


def digest(problem, elements=10, scheme=None):
    return structure_of(problem, scheme or radau(3), elements, unscaled(problem, 0))


def test_numbers_of_limits_and_ends_do_not_change_the_structure():
    assert digest(swing()) == digest(swing(goal=0.5, limit=3.0)) == digest(swing(horizon=Free(1.0, upper=9.0)))


@pytest.mark.parametrize(
    "other",
    [
        {"drag": 0.2},
        {"swapped": True},
        {"horizon": Fixed(2.0)},
        {"running": lambda x, u: u**2},
        {"running": lambda x, u: u**2 + x[0] ** 2},
    ],
)
def test_everything_in_the_graphs_changes_it(other):
    assert digest(swing(**other)) != digest(swing())
    assert len({digest(swing(), 10), digest(swing(), 11), digest(swing(), 10, radau(4))}) == 3


def test_a_kept_nlp_gives_the_same_digits():
    forget_structures()
    first = solve(swing(), grid=uniform(20), solver=QUIET)
    other = solve(swing(goal=0.7, limit=1.7), grid=uniform(20), solver=QUIET)
    again = solve(swing(), grid=uniform(20), solver=QUIET)
    forget_structures()
    anew = solve(swing(goal=0.7, limit=1.7), grid=uniform(20), solver=QUIET)
    assert (first.cost, first.iterations) == (again.cost, again.iterations)
    assert (other.cost, other.iterations) == (anew.cost, anew.iterations)
    np.testing.assert_array_equal(other.states, anew.states)
    assert again.problem is not first.problem


def test_solvers_are_shared_only_with_the_same_settings():
    forget_structures()
    one, other = (prepare(swing(), grid=uniform(5), solver=QUIET) for _ in range(2))
    assert one.cold is other.cold
    assert prepare(swing(), grid=uniform(5), solver=Ipopt(tol=1e-6, progress=False)).cold is not one.cold


def test_equations_along_the_motion_are_not_kept():
    problem = swing()
    x, u = problem.system.x, problem.system.u
    held = Problem(problem.system, problem.horizon, problem.minimise, (*problem.subject_to, along(x[1] - u, 0.1, 0.1)))
    assert digest(held) == b""


def test_the_oldest_is_dropped_first():
    cache, made = ThreadCache(2), []
    for key in ("a", "b", "a", "c", "a", "b"):
        assert cache.get(key, lambda key=key: made.append(key) or key.upper()) == key.upper()
    assert made == ["a", "b", "c", "b"]
    cache.clear()
    assert cache.get("a", lambda: 1) == 1
