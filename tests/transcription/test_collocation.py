"""Collocation schemes: identities, known points, measured orders on a problem with a closed solution."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from ocp import Bolza, Control, Fixed, Ipopt, Problem, System, end, legendre, lobatto, radau, solve, start, uniform

MAKERS = {"radau": radau, "legendre": legendre, "lobatto": lobatto}
CASES = [(name, d) for name in MAKERS for d in range(1, 13) if (name, d) != ("lobatto", 1)]
LOW = [(name, d) for name, d in CASES if d <= 4]
EXACT_DEGREE = {"radau": lambda d: 2 * d - 2, "legendre": lambda d: 2 * d - 1, "lobatto": lambda d: 2 * d - 3}
ORDER = {"radau": lambda d: 2 * d - 1, "legendre": lambda d: 2 * d, "lobatto": lambda d: 2 * d - 2}
r2, r3, r5, r6, r15 = np.sqrt([2.0, 3.0, 5.0, 6.0, 15.0])
# Hairer, Wanner, Solving Ordinary Differential Equations II, tables IV.5.1 to IV.5.7.
POINTS = {
    ("radau", 1): [1.0],
    ("radau", 2): [1 / 3, 1.0],
    ("radau", 3): [(4 - r6) / 10, (4 + r6) / 10, 1.0],
    ("legendre", 1): [0.5],
    ("legendre", 2): [(3 - r3) / 6, (3 + r3) / 6],
    ("legendre", 3): [(5 - r15) / 10, 0.5, (5 + r15) / 10],
    ("lobatto", 2): [0.0, 1.0],
    ("lobatto", 3): [0.0, 0.5, 1.0],
    ("lobatto", 4): [0.0, (5 - r5) / 10, (5 + r5) / 10, 1.0],
}
WEIGHTS = {
    ("radau", 1): [1.0],
    ("radau", 2): [3 / 4, 1 / 4],
    ("radau", 3): [(16 - r6) / 36, (16 + r6) / 36, 1 / 9],
    ("legendre", 1): [1.0],
    ("legendre", 2): [1 / 2, 1 / 2],
    ("legendre", 3): [5 / 18, 4 / 9, 5 / 18],
    ("lobatto", 2): [1 / 2, 1 / 2],
    ("lobatto", 3): [1 / 6, 2 / 3, 1 / 6],
    ("lobatto", 4): [1 / 12, 5 / 12, 5 / 12, 1 / 12],
}
DENSE = np.linspace(0.0, 1.0, 101)


def polynomials(degree):
    """Return pairs (p, p') of a basis that is well conditioned on [0, 1]."""
    for k in range(degree + 1):
        p = np.polynomial.Chebyshev.basis(k, domain=[0.0, 1.0])
        yield p, p.deriv()


def data(scheme, p, slope):
    """Return what defines the state polynomial of an element, for x(tau) = p(tau)."""
    return np.concatenate([p(scheme.nodes), [slope(0.0)] * scheme.slope_at_start])


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0]}{case[1]}")
def scheme(request):
    name, degree = request.param
    return MAKERS[name](degree, Control.COLLOCATED)


def test_layout(scheme):
    assert len(scheme.points) == len(scheme.weights) == len(scheme.at) == scheme.degree
    assert scheme.nodes[0] == 0.0
    assert scheme.nodes[-1] == 1.0
    assert np.all(np.diff(scheme.nodes) > 0.0)
    np.testing.assert_array_equal(scheme.nodes[list(scheme.at)], scheme.points)
    assert scheme.state.shape == (len(scheme.rate), len(scheme.nodes))
    assert len(scheme.rate) == len(scheme.nodes) - 1  # one condition for each node but the first
    assert scheme.order == ORDER[scheme.name](scheme.degree)


@pytest.mark.parametrize("case", POINTS, ids=lambda case: f"{case[0]}{case[1]}")
def test_known_points_and_weights(case):
    made = MAKERS[case[0]](case[1])
    np.testing.assert_allclose(made.points, POINTS[case], rtol=0, atol=1e-15)
    np.testing.assert_allclose(made.weights, WEIGHTS[case], rtol=0, atol=1e-15)


def test_quadrature(scheme):
    assert np.sum(scheme.weights) == pytest.approx(1.0, abs=1e-14)
    assert np.all(scheme.weights > 0.0)
    for k in range(EXACT_DEGREE[scheme.name](scheme.degree) + 1):
        assert scheme.weights @ scheme.points**k == pytest.approx(1.0 / (k + 1), abs=1e-14), f"degree {k}"


@pytest.mark.parametrize(("name", "degree"), LOW)
def test_quadrature_is_exact_to_no_higher_degree(name, degree):
    made, k = MAKERS[name](degree), EXACT_DEGREE[name](degree) + 1
    assert abs(made.weights @ made.points**k - 1.0 / (k + 1)) > 1e-6


def test_defects_vanish_for_polynomials(scheme):
    for k, (p, slope) in enumerate(polynomials(scheme.degree)):
        defects = scheme.state @ p(scheme.nodes) - scheme.rate @ slope(scheme.points)
        np.testing.assert_allclose(defects, 0.0, atol=2e-11, err_msg=f"degree {k}")


@pytest.mark.parametrize(("name", "degree"), LOW)
def test_defects_see_a_degree_more(name, degree):
    made = MAKERS[name](degree)
    *_, (p, slope) = polynomials(degree + 1)
    assert np.max(np.abs(made.state @ p(made.nodes) - made.rate @ slope(made.points))) > 1e-2


def test_state_interpolation(scheme):
    for p, slope in polynomials(scheme.degree):
        np.testing.assert_allclose(scheme.state_at(DENSE) @ data(scheme, p, slope), p(DENSE), rtol=0, atol=1e-11)
        scale = np.max(np.abs(slope(DENSE))) + 1.0
        np.testing.assert_allclose(scheme.slope_at(DENSE) @ data(scheme, p, slope), slope(DENSE), atol=1e-10 * scale)


def test_slope_of_a_constant_and_of_time(scheme):
    constant, time = (
        data(scheme, p, p.deriv()) for p in (np.polynomial.Polynomial([1.0]), np.polynomial.Polynomial([0.0, 1.0]))
    )
    np.testing.assert_allclose(scheme.slope_at(DENSE) @ constant, 0.0, atol=2e-11)
    np.testing.assert_allclose(scheme.slope_at(DENSE) @ time, 1.0, atol=2e-11)


@pytest.mark.parametrize("control", Control)
def test_control_interpolation(scheme, control):
    shaped = replace(scheme, control=control)
    degree = {Control.CONSTANT: 0, Control.COLLOCATED: scheme.degree - 1}.get(control, 1)
    for p, _ in polynomials(degree):
        np.testing.assert_allclose(shaped.control_at(DENSE) @ p(shaped.control_nodes), p(DENSE), rtol=0, atol=1e-11)


def test_costate_interpolation(scheme):
    for p, _ in polynomials(scheme.degree - 1):
        np.testing.assert_allclose(scheme.costate_at(DENSE) @ p(scheme.points), p(DENSE), rtol=0, atol=1e-11)


def test_interpolation_does_not_amplify(scheme):
    # Lebesgue constants; equidistant points would have 51 at twelve of them.
    assert np.max(np.sum(np.abs(scheme.state_at(DENSE)), axis=1)) < 15.0
    assert np.linalg.cond(scheme.state[:, 1:]) < 1e3


def grown(scheme, z):
    """Return x(1) of x' = z x, x(0) = 1 on one element."""
    picked = np.eye(len(scheme.nodes))[list(scheme.at)]
    matrix = scheme.state - z * scheme.rate @ picked
    return np.linalg.solve(matrix[:, 1:], -matrix[:, 0])[-1]


@pytest.mark.parametrize("z", [-5.0, -0.5, 0.3])
def test_stability_functions(z):
    # Pade approximations of exp: Hairer, Wanner, IV.3, table 3.1.
    pade = {
        ("radau", 1): 1 / (1 - z),
        ("radau", 2): (1 + z / 3) / (1 - 2 * z / 3 + z**2 / 6),
        ("radau", 3): (1 + 2 * z / 5 + z**2 / 20) / (1 - 3 * z / 5 + 3 * z**2 / 20 - z**3 / 60),
        ("legendre", 1): (1 + z / 2) / (1 - z / 2),
        ("legendre", 2): (1 + z / 2 + z**2 / 12) / (1 - z / 2 + z**2 / 12),
        ("lobatto", 2): (1 + z / 2) / (1 - z / 2),
        ("lobatto", 3): (1 + z / 2 + z**2 / 12) / (1 - z / 2 + z**2 / 12),
    }
    for (name, degree), expected in pade.items():
        assert grown(MAKERS[name](degree), z) == pytest.approx(expected, rel=1e-13), f"{name} {degree}"


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
@pytest.mark.parametrize("degree", [0, -1, 13, 2.0, "3", None, True])
def test_wrong_degree(make, degree):
    with pytest.raises(ValueError, match=r"degree: got .*, expected a whole number .* 12"):
        make(degree)


def test_lobatto_needs_both_ends():
    with pytest.raises(ValueError, match=r"degree: got 1, .* from 2 to 12"):
        lobatto(1)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
@pytest.mark.parametrize("control", ["constant", None, 1])
def test_wrong_control(make, control):
    with pytest.raises(
        TypeError, match=r"control: got .*Control\.CONSTANT, Control\.LINEAR, Control\.SEGMENTS, Control\.COLLOCATED"
    ):
        make(3, control)


# A point mass in polar coordinates, x = (phi, r, phi', r'), u = (r F_phi, F_r), min int |F|^2 from rest to rest. In
# the plane p = p0 + (3 s^2 - 2 s^3) dp, F = m p", and the costates are 2 m F' and -2 m F, pulled back to x.
MASS, TIME, FROM, TO = 2.0, 1.2, (0.0, 1.0), (1.2, 0.6)


def polar():
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    r, turn, slide = x[1], x[2], x[3]
    rate = ca.vertcat(turn, slide, (u[0] / (MASS * r) - 2 * slide * turn) / r, u[1] / MASS + r * turn**2)
    cost = Bolza(running=(u[0] / r) ** 2 + u[1] ** 2)
    ends = start(x, [*FROM, 0, 0]), end(x, [*TO, 0, 0])
    return Problem(System(x, u, ca.SX(0, 1), rate), Fixed(TIME), cost, ends)


def straight(t):
    """Return state, control and costate at times t, and the cost."""
    s = (t / TIME)[:, None]
    first, last = (q[1] * np.array([np.cos(q[0]), np.sin(q[0])]) for q in (FROM, TO))
    way = last - first
    p, v = first + (3 * s**2 - 2 * s**3) * way, (6 * s - 6 * s**2) / TIME * way
    f, df = MASS * (6 - 12 * s) / TIME**2 * way, MASS * -12 / TIME**3 * way * np.ones_like(s)
    r, phi = np.hypot(*p.T)[:, None], np.arctan2(p[:, 1], p[:, 0])
    out, around = np.stack([np.cos(phi), np.sin(phi)], axis=1), np.stack([-np.sin(phi), np.cos(phi)], axis=1)

    def dot(a, b):
        return np.sum(a * b, axis=1, keepdims=True)

    slide, turn = dot(v, out), dot(v, around) / r
    x = np.hstack([phi[:, None], r, turn, slide])
    u = np.hstack([r * dot(f, around), dot(f, out)])
    by_p, by_v = 2 * MASS * df, -2 * MASS * f
    costate = np.hstack(
        [
            dot(by_p, r * around) + dot(by_v, slide * around - r * turn * out),
            dot(by_p, out) + dot(by_v, turn * around),
            dot(by_v, r * around),
            dot(by_v, out),
        ]
    )
    return x, u, costate, 12 * MASS**2 * (way @ way) / TIME**3


def errors(scheme, elements):
    solution = solve(polar(), scheme, uniform(elements), Ipopt(tol=1e-12))
    assert solution.ok, solution.message
    x, _, _, cost = straight(solution.nodes)
    _, u, costate, _ = straight(solution.collocation_times.ravel())
    nu, nx = u.shape[1], x.shape[1]
    return (
        abs(solution.cost - cost),
        np.max(np.abs(solution.x(solution.nodes) - x)),
        np.max(np.abs(solution.controls.reshape(-1, nu) - u)),
        np.max(np.abs(solution.costates.reshape(-1, nx) - costate)),
    )


@cache
def measured_orders(name, degree):
    grids = {1: (16, 32, 64, 128), 2: (8, 16, 32, 64)}.get(degree, (8, 16, 32))
    if (name, degree) == ("radau", 3):
        grids = (32, 48, 64, 96)  # on coarser ones the error of the cost changes its sign
    found = np.log([errors(MAKERS[name](degree, Control.COLLOCATED), n) for n in grids])
    return dict(zip(("cost", "state", "control", "costate"), -np.polyfit(np.log(grids), found, 1)[0], strict=True))


@pytest.mark.parametrize("what", ["cost", "state", "control", "costate"])
@pytest.mark.parametrize(("name", "degree"), [(n, d) for n, d in LOW if d <= 3])
def test_measured_order(name, degree, what):
    ends, inside = ORDER[name](degree), {"radau": degree, "legendre": degree + 1, "lobatto": degree - 1}[name]
    claimed = ends if what in ("cost", "state") else inside
    assert measured_orders(name, degree)[what] > claimed - 0.35
