"""The NLP: its derivatives against CasADi's own, its rows against plain numpy, its costates against calculus."""

from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Guess,
    Ipopt,
    Problem,
    System,
    along,
    end,
    given,
    legendre,
    lobatto,
    prepare,
    radau,
    solve,
    start,
    uniform,
)
from ocp.solving.guess_conversion import from_solution
from ocp.transcription.direct_collocation import transcribe
from ocp.transcription.nlp import bounds
from ocp.transcription.packing import pack, unpack
from ocp.transcription.scaling import Scaling, unscaled

GRID = given([0.0, 0.2, 0.65, 1.0])
MAKERS = {"radau": radau, "legendre": legendre, "lobatto": lobatto}
VALUES = [0.7, 1.3]


def coupled(horizon, free_parameter=False, bare=False):
    """Return a problem without symmetry that uses every kind of constraint and cost."""
    x, u, p = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("p", 2)
    rate = ca.vertcat(x[1] * ca.cos(x[2]), u[0] * x[0] - p[0] * ca.sin(x[1]), u[1] * x[1] ** 2 + p[1] * x[2] * u[0])
    signals = {"power": x[1] * u[0] + p[1] * u[1], "reach": x[0] ** 2 + p[0] * x[2] ** 2}
    system = System(x, u, p, rate, signals, {"a": VALUES[0], "b": VALUES[1]})
    conditions = [start(x, [0.3, 0.4, 0.5]), end(x[0], 1.0), along(u, [-2, -3], [2, 3]), along(x[2], -4, 4)]
    cost = Bolza(time=0.7, running=u[0] ** 2 * x[2] + p[1] * x[0] ** 4 + ca.exp(u[1]), final=x[1] ** 3 * x[0] + p[0])
    if bare:
        return Problem(system, horizon, Bolza(running=ca.sumsqr(u)), tuple(conditions[:3]))
    conditions += [
        along(system["power"], -9, 9),
        along(system["reach"], upper=50),
        end(x[0] * x[2], 0.1, 7),
        start(u[0] * x[1], -5, 5),
    ]
    if free_parameter:
        conditions.append(along(p[1], 0.5, 2.0))
    return Problem(system, horizon, cost, tuple(conditions))


PROBLEMS = {
    "free_horizon": lambda: coupled(Free(1.5)),
    "fixed_horizon": lambda: coupled(Fixed(1.5)),
    "free_parameter": lambda: coupled(Free(1.5), free_parameter=True),
    "parameter_fixed_horizon": lambda: coupled(Fixed(1.5), free_parameter=True),
    "no_rows_but_defects": lambda: coupled(Fixed(1.5), bare=True),
}
# Every scheme with every control once on every problem would say the same more slowly.
CASES = [
    *(("free_parameter", name, 2, control) for name, control in product(MAKERS, Control)),
    *((problem, "radau", 3, Control.CONSTANT) for problem in PROBLEMS),
    *((problem, "legendre", 3, Control.COLLOCATED) for problem in PROBLEMS),
    ("free_horizon", "radau", 1, Control.LINEAR),
]


def programme_of(problem, name, degree, control):
    scaling = Scaling(np.array([2.0, 0.5, 4.0]), np.array([0.25, 8.0]), 2.0, np.full(len(problem_free(problem)), 0.5))
    return transcribe(problem, MAKERS[name](degree, control), GRID, scaling)


def problem_free(problem):
    return [
        c for c in problem.subject_to if ca.depends_on(c.expression, problem.system.p) and c.expression.is_symbolic()
    ]


def parameters(problem):
    fixed = [problem.horizon.duration] if isinstance(problem.horizon, Fixed) else []
    return np.array([*VALUES, *fixed, *GRID.widths])


@pytest.mark.parametrize(("problem", "name", "degree", "control"), CASES)
def test_derivatives_are_those_of_the_programme(problem, name, degree, control):
    nlp = programme_of(PROBLEMS[problem](), name, degree, control)
    z, s, f, g = (nlp.expressions[key] for key in ("x", "p", "f", "g"))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    curvature = ca.hessian(lam_f * f + ca.dot(lam_g, g), z)[0]
    expected = ca.Function("ad", [z, s, lam_f, lam_g], [f, g, ca.gradient(f, z), ca.jacobian(g, z), ca.triu(curvature)])
    rng = np.random.default_rng(5)
    for _ in range(3):
        at = rng.uniform(0.2, 1.0, z.numel()), parameters(nlp.problem)
        multipliers = rng.normal(), rng.normal(size=g.numel())
        cost, rows, gradient, jacobian, hessian = (np.array(part) for part in expected(*at, *multipliers))
        found_cost, found_gradient = nlp.derivatives["grad_f"](*at)
        found_rows, found_jacobian = nlp.derivatives["jac_g"](*at)
        found_hessian = nlp.derivatives["hess_lag"](*at, *multipliers)
        for found, wanted in (
            (found_cost, cost),
            (found_rows, rows),
            (found_gradient, gradient),
            (found_jacobian, jacobian),
            (found_hessian, hessian),
        ):
            size = np.max(np.abs(wanted))
            assert size > 0.0 or wanted is hessian
            np.testing.assert_allclose(np.array(found), wanted, rtol=0, atol=1e-12 * size)


# State and rate matrices of three schemes, derived by hand from Lagrange polynomials on their nodes.
BY_HAND = {
    ("radau", 2): ([0, 1 / 3, 1], [1 / 3, 1], [3 / 4, 1 / 4], [[-2, 3 / 2, 1 / 2], [2, -9 / 2, 5 / 2]], np.eye(2)),
    ("legendre", 1): ([0, 1 / 2, 1], [1 / 2], [1], [[-2, 2, 0], [1, -2, 1]], [[1], [0]]),
    ("lobatto", 2): ([0, 1], [0, 1], [1 / 2, 1 / 2], [[-2, 2]], [[1, 1]]),
}
SHAPES = {
    Control.CONSTANT: lambda a, b, t: (a + b) / 2 + 0 * t,
    Control.LINEAR: lambda a, b, t: t,
    Control.SEGMENTS: lambda a, b, t: t,
    Control.COLLOCATED: lambda a, b, t: t,
}


def line(share):
    """Return a state and a control that are linear in the share, so that a Guess holds them exactly."""
    share = np.asarray(share, dtype=float)[..., None]
    x = np.array([0.3, 0.4, 0.5]) + share * np.array([0.7, -0.6, 0.2])
    return x, np.array([0.9, -0.4]) + share * np.array([-1.1, 0.8])


def rate_by_numpy(x, u, p):
    x0, x1, x2, u0, u1 = *np.moveaxis(x, -1, 0), *np.moveaxis(u, -1, 0)
    return np.stack([x1 * np.cos(x2), u0 * x0 - p[0] * np.sin(x1), u1 * x1**2 + p[1] * x2 * u0], axis=-1)


def power_by_numpy(x, u, p):
    return x[..., 1] * u[..., 0] + p[1] * u[..., 1]


def reach_by_numpy(x, p):
    return x[..., 0] ** 2 + p[0] * x[..., 2] ** 2


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("case", BY_HAND, ids=lambda case: case[0])
def test_rows_and_cost_by_hand(case, control):
    problem = coupled(Free(1.5), free_parameter=True)
    nlp = programme_of(problem, *case, control)
    ends, duration, p = np.array([0.0, 1.0]), 1.7, (VALUES[0], 0.8)
    z = pack(nlp, Guess(ends, *line(ends), duration, np.array([p[1]])), VALUES)
    x, s, f, g = (nlp.expressions[key] for key in ("x", "p", "f", "g"))
    function = ca.Function("fg", [x, s], [f, g])
    cost, rows = (np.array(part).ravel() for part in function(z, parameters(problem)))

    nodes, points, weights, state, by_rate = (np.array(part) for part in BY_HAND[case])
    shape = SHAPES[control if len(points) > 1 or control is not Control.COLLOCATED else Control.CONSTANT]
    # On every element: a state at its points and its right end; a control where it may jump as seen from inside, but
    # not beyond the points of a polynomial. What leaves out the left ends holds at the start once.
    right = sorted({*points, 1.0} - {0.0})
    taken = {Control.LINEAR: right, Control.COLLOCATED: sorted(points)}
    integral, defects, power, reach = 0.0, [], [], []
    for a, b in zip(GRID.ends[:-1], GRID.ends[1:], strict=True):
        h = (b - a) * duration

        def motion(tau, a=a, b=b):
            t = a + (b - a) * np.array(tau)
            return line(t)[0], line(shape(a, b, t))[1]

        (x_nodes, _), (x, u) = motion(nodes), motion(points)
        defects.append(state @ x_nodes - h * by_rate @ rate_by_numpy(x, u, p))
        integral += h * weights @ (u[:, 0] ** 2 * x[:, 2] + p[1] * x[:, 0] ** 4 + np.exp(u[:, 1]))
        power.append(power_by_numpy(*motion(taken.get(control, sorted({0.0, *points, 1.0}))), p))
        reach.append(reach_by_numpy(motion(right)[0], p))
    first, last = line(0.0)[0], line(1.0)[0]
    first_u = line(shape(GRID.ends[0], GRID.ends[1], 0.0))[1]
    assert cost == pytest.approx(integral + last[1] ** 3 * last[0] + p[0] + 0.7 * duration, rel=1e-13)
    found = rows[nlp.defects] * nlp.scaling.x
    np.testing.assert_allclose(found, defects, rtol=0, atol=1e-13)
    np.testing.assert_allclose(rows[nlp.path[0]], power, rtol=0, atol=1e-13)
    np.testing.assert_allclose(rows[nlp.path[1]], reach, rtol=0, atol=1e-13)
    expected = [power_by_numpy(first, first_u, p)] if control is Control.LINEAR else []
    expected += [reach_by_numpy(first, p), last[0] * last[2], first_u[0] * 0.4]
    np.testing.assert_allclose(rows[nlp.ends], expected, rtol=0, atol=1e-13)
    assert nlp.rows == len(rows)


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("case", BY_HAND, ids=lambda case: case[0])
def test_pack_and_unpack(case, control):
    nlp = programme_of(coupled(Free(1.5), free_parameter=True), *case, control)
    ends = np.array([0.0, 1.0])
    z = pack(nlp, Guess(ends, *line(ends), 1.7, np.array([0.8])), VALUES)
    motion = unpack(nlp, z, np.zeros(nlp.rows), np.zeros(len(z)), VALUES)
    assert motion.duration == 1.7
    assert motion.free == {"b": 0.8}
    assert motion.values == {"a": 0.7, "b": 0.8}
    shares = GRID.ends[:-1, None] + GRID.widths[:, None] * np.array(BY_HAND[case][0])
    np.testing.assert_allclose(motion.states, line(shares)[0], rtol=0, atol=1e-15)
    taken = {Control.CONSTANT: [0.5], Control.COLLOCATED: BY_HAND[case][1]}.get(control, [0.0, 1.0])
    shares = GRID.ends[:-1, None] + GRID.widths[:, None] * np.array(taken)
    np.testing.assert_allclose(motion.controls, line(shares)[1], rtol=0, atol=1e-15)


def test_limits_become_bounds_in_scaled_units():
    nlp = programme_of(coupled(Free(1.5, 0.5, 6.0), free_parameter=True), "radau", 2, Control.CONSTANT)
    low, high, rows_low, rows_high = bounds(nlp)
    layout, scaling = nlp.layout, nlp.scaling
    np.testing.assert_array_equal(low[layout.control] * scaling.u, np.broadcast_to([-2.0, -3.0], (3, 1, 2)))
    np.testing.assert_array_equal(high[layout.control] * scaling.u, np.broadcast_to([2.0, 3.0], (3, 1, 2)))
    np.testing.assert_array_equal(low[layout.state[0, 0]] * scaling.x, [0.3, 0.4, 0.5])
    np.testing.assert_array_equal(high[layout.state[0, 0]] * scaling.x, [0.3, 0.4, 0.5])
    np.testing.assert_array_equal(high[layout.state[1, 1]] * scaling.x, [np.inf, np.inf, 4.0])
    assert (low[layout.state[-1, -1, 0]], high[layout.state[-1, -1, 0]]) == (0.5, 0.5)
    assert (low[layout.horizon[0]] * 2.0, high[layout.horizon[0]] * 2.0) == (0.5, 6.0)
    assert (low[layout.free[0]] * 0.5, high[layout.free[0]] * 0.5) == (0.5, 2.0)
    assert not np.any(rows_low[nlp.defects])
    assert not np.any(rows_high[nlp.defects])
    for rows, sides in zip(nlp.path, [(-9.0, 9.0), (-np.inf, 50.0)], strict=True):
        assert set(rows_low[rows].ravel()) == {sides[0]}
        assert set(rows_high[rows].ravel()) == {sides[1]}
    np.testing.assert_array_equal(rows_low[nlp.ends], [-np.inf, 0.1, -5.0])
    np.testing.assert_array_equal(rows_high[nlp.ends], [50.0, 7.0, 5.0])


X0, T = 1.4, 2.0


def regulator(x0=X0, limit=None, weight=0.0):
    """Return min 1/2 int x^2 + u^2 + weight/2 x(T)^2 with x' = u."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    cost = Bolza(running=(x**2 + u**2) / 2, final=weight * x**2 / 2)
    limits = () if limit is None else (along(x, -limit, limit), along(u, -limit, limit))
    return Problem(System(x, u, ca.SX(0, 1), u), Fixed(T), cost, (start(x, x0), *limits))


@pytest.mark.parametrize("limit", [None, 900.0])
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_costate_of_a_regulator(make, limit):
    grid = given(np.concatenate([np.linspace(0.0, 0.3, 13), np.linspace(0.3, 1.0, 16)[1:]]))
    solution = solve(regulator(limit=limit), make(5, Control.COLLOCATED), grid, Ipopt(tol=1e-11))
    assert solution.ok
    t = solution.collocation_times
    np.testing.assert_allclose(solution.costates[:, :, 0], X0 * np.sinh(T - t) / np.cosh(T), rtol=0, atol=1e-6)
    assert solution.costate(0.0)[0] == pytest.approx(X0 * np.tanh(T), abs=1e-5)
    assert solution.cost == pytest.approx(X0**2 * np.tanh(T) / 2, rel=1e-9)


def test_costate_ends_with_the_slope_of_the_final_cost():
    solution = solve(regulator(limit=900.0, weight=3.0), radau(4, Control.COLLOCATED), uniform(20))
    assert solution.costates[-1, -1, 0] == pytest.approx(3.0 * solution.states[-1, -1, 0], abs=1e-6)
    first = X0 * (np.sinh(T) + 3.0 * np.cosh(T)) / (np.cosh(T) + 3.0 * np.sinh(T))
    assert solution.costate(0.0)[0] == pytest.approx(first, abs=1e-5)
    assert solution.cost == pytest.approx(X0 * first / 2, rel=1e-9)


@pytest.mark.parametrize("make", [radau, legendre], ids=lambda make: make.__name__)
def test_costate_of_a_double_integrator_in_least_time(make):
    # T = 2 sqrt(d) from rest; a start nearer by dx saves dx / sqrt(d), and the switching function crosses zero at T/2.
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u))
    problem = Problem(system, subject_to=(start(x, 0), end(x, [4.0, 0]), along(u, -1, 1)))
    solution = solve(problem, make(3), uniform(20))
    t = solution.collocation_times
    np.testing.assert_allclose(solution.costates[:, :, 0], -0.5, rtol=0, atol=1e-6)
    np.testing.assert_allclose(solution.costates[:, :, 1], -0.5 * (2.0 - t), rtol=0, atol=1e-6)


@pytest.mark.parametrize("horizon", [Fixed(1.5), Free(1.0)], ids=["fixed", "free"])
def test_costate_is_the_slope_of_the_cost(horizon):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u - ca.sin(x[0])))
    cost = Bolza(time=2.0, running=u**2)
    begin = np.array([0.2, -0.3])
    problem = Problem(system, horizon, cost, (start(x, begin), end(x, [2.0, 0.0])))
    prepared = prepare(problem, radau(5, Control.COLLOCATED), uniform(12), Ipopt(tol=1e-11))

    def cost_from(state):
        moved = replace(problem, subject_to=(start(x, state), problem.subject_to[1]))
        found = prepared(problem=moved)
        assert found.ok
        return found.cost

    step = 1e-4
    slopes = [(cost_from(begin + d) - cost_from(begin - d)) / (2 * step) for d in step * np.eye(2)]
    np.testing.assert_allclose(prepared().costate(0.0), slopes, rtol=1e-5)


@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_solution_as_guess_keeps_the_motion(make, control):
    problem = regulator(limit=900.0)
    solution = solve(problem, make(3, control), uniform(10))
    assert np.ptp(solution.states) > 1.0
    nlp = transcribe(problem, make(3, control), uniform(10), unscaled(problem, 0))
    z = pack(nlp, from_solution(solution), [])
    again = unpack(nlp, z, np.zeros(nlp.rows), np.zeros(len(z)), [])
    np.testing.assert_allclose(again.states, solution.states, rtol=0, atol=1e-6)
    # Where two elements meet, a polynomial control has two values, of which a guess can hold the middle only.
    nodes = solution.scheme.control_nodes
    kept = (nodes % 1.0 > 0.0) if control is Control.COLLOCATED else np.full(len(nodes), True)
    np.testing.assert_allclose(again.controls[:, kept], solution.controls[:, kept], rtol=0, atol=1e-6)
