"""Published optimal-control problems with their optimal values: closed forms where there are, else published digits."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from catalogue import problems

from ocp import Ball, Bolza, Fixed, Free, Problem, System, along, end, outside, start

INF = np.inf
BETTS = "J. T. Betts, Practical Methods for Optimal Control Using Nonlinear Programming, 2010"
BRYSON = "A. E. Bryson, Y. C. Ho, Applied Optimal Control, 1975"
COPS = "E. D. Dolan, J. J. More, T. S. Munson, Benchmarking Optimization Software with COPS 3.0, 2004"
KIRK = "D. E. Kirk, Optimal Control Theory, 1970"
LUUS = "R. Luus, Iterative Dynamic Programming, 2000"
MAURER = (
    "D. Augustin, H. Maurer, Computational sensitivity analysis for state constrained optimal control problems, 2001"
)
MINTOC = "S. Sager, mintoc.de, a benchmark library of mixed-integer optimal control problems"
PSOPT = "V. M. Becerra, PSOPT Optimal Control Solver User Manual"


@dataclass(frozen=True)
class Published:
    """A problem as stated, and the value of its cost.

    Args:
        make: returns the Problem; its cost is minimised, so that maxima have a negative sign.
        value: optimal cost.
        digits: half a unit of its last digit; zero for closed forms.
        source: of the problem and its value.
        others: costs of other local optima; solutions are compared with the nearest optimum.
    """

    make: Callable[[], Problem]
    value: float
    digits: float
    source: str
    others: tuple[float, ...] = ()

    def nearest(self, cost: float) -> float:
        """Return the optimum nearest to a cost."""
        return min((self.value, *self.others), key=lambda one: abs(one - cost))


def axis(n, nu=1):
    return ca.SX.sym("x", n), ca.SX.sym("u", nu)


def system(x, u, *rate, **signals):
    return System(x, u, ca.SX(0, 1), ca.vertcat(*rate), signals)


def problem(x, u, rate, horizon, cost, *constraints):
    return Problem(system(x, u, *rate), horizon, cost, constraints)


TIME = Bolza(time=1.0)


# -- minimum time -----------------------------------------------------------------------------------------------------


def oscillator():
    """From rest at 2 to rest at 0 with |u| <= 1: an arc of pi about (1, 0), then no more: T = pi, one arc."""
    x, u = axis(2)
    return problem(x, u, (x[1], u - x[0]), Free(2.0), TIME, start(x, [2.0, 0.0]), end(x, 0.0), along(u, -1.0, 1.0))


def double_integrator():
    """From (1, 1) to 0: T = v + 2 sqrt(x + v^2/2)."""
    x, u = axis(2)
    return problem(x, u, (x[1], u), Free(2.0), TIME, start(x, 1.0), end(x, 0.0), along(u, -1.0, 1.0))


def van_der_pol_fastest():
    x, u = axis(2)
    rate = x[1], -x[0] + x[1] * (1.0 - x[0] ** 2) + u
    return problem(x, u, rate, Free(2.0), TIME, start(x, 1.0), end(ca.sumsqr(x), 0.04), along(u, -1.0, 1.0))


def rayleigh_rate(x, u):
    return x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] ** 2) + 4.0 * u


def rayleigh_fastest():
    x, u = axis(2)
    return problem(x, u, rayleigh_rate(x, u), Free(3.0), TIME, start(x, -5.0), end(x, 0.0), along(u, -1.0, 1.0))


def f8():
    x, w = axis(3)
    a, b, c = ca.vertsplit(x)
    rate = (
        -0.877 * a + c - 0.088 * a * c + 0.47 * a**2 - 0.019 * b**2 - a**2 * c + 3.846 * a**3
        - 0.215 * w + 0.28 * a**2 * w + 0.47 * a * w**2 + 0.63 * w**3,
        c,
        -4.208 * a - 0.396 * c - 0.47 * a**2 - 3.564 * a**3 - 20.967 * w + 6.265 * a**2 * w + 46.0 * a * w**2
        + 61.4 * w**3,
    )  # fmt: skip
    limits = start(x, [0.4655, 0.0, 0.0]), end(x, 0.0), along(w, -0.05236, 0.05236)
    return problem(x, w, rate, Free(3.0), TIME, *limits)


def zermelo():
    """A current -y along x, a boat of speed one, from (3.66, -1.86) to the origin."""
    x, u = axis(2)
    rate = ca.cos(u) - x[1], ca.sin(u)
    return problem(x, u, rate, Free(5.0), TIME, start(x, [3.66, -1.86]), end(x, 0.0))


def tangent_steering():
    x, u = axis(4)
    rate = x[2], x[3], 100.0 * ca.cos(u), 100.0 * ca.sin(u)
    limits = start(x, 0.0), end(x[1:], [5.0, 45.0, 0.0]), along(u, -np.pi / 2.0, np.pi / 2.0)
    return problem(x, u, rate, Free(1.0), TIME, *limits)


def dubins():
    x, u = axis(3)
    rate = ca.cos(x[2]), ca.sin(x[2]), u
    limits = start(x, 0.0), end(x, [3.0, 4.0, 0.0]), along(u, -1.0, 1.0)
    return problem(x, u, rate, Free(5.0), TIME, *limits)


def dubins_length():
    """Left, straight, right over (3, 4) with equal headings: both turns have the angle a of the straight line."""
    # Centres (0, 1) and (3, 3), distance D; the straight line of length sqrt(D^2 - 4) crosses between them.
    d = np.hypot(3.0, 2.0)
    angle = np.arctan2(2.0, 3.0) + np.arcsin(2.0 / d)
    return float(2.0 * angle + np.sqrt(d**2 - 4.0))


DISCS = np.array([[0.4, 0.5], [0.8, 1.5]]), np.sqrt(0.1), np.array([1.2, 1.6])


def discs():
    """Shortest way from the origin past two discs, as the constant speed that it takes in one second."""
    x, u = axis(2, 2)
    centres, radius, goal = DISCS
    posts = [outside(Ball(one, radius), x) for one in centres]
    return problem(x, u, (u[0], u[1]), Fixed(1.0), Bolza(running=ca.sumsqr(u)), start(x, 0.0), end(x, goal), *posts)


def discs_cost():
    """Length squared of the taut string: past one disc where it keeps clear of the other, or past both."""
    centres, radius, goal = DISCS

    def turned(vector, angle):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])

    def touching(point, centre, side):  # where a string from a point touches, the disc on the right (1) or left (-1)
        apart = point - centre
        return centre + radius * turned(
            apart / np.linalg.norm(apart), -side * np.arccos(radius / np.linalg.norm(apart))
        )

    def arc(centre, first, last, side):
        angles = [np.arctan2(*(p - centre)[::-1]) for p in (first, last)]
        return radius * ((side * (angles[0] - angles[1])) % (2.0 * np.pi))

    best = np.inf
    for k, side in ((0, 1), (0, -1), (1, 1), (1, -1)):
        touch = touching(np.zeros(2), centres[k], side), touching(goal, centres[k], -side)
        clear = all(
            np.min(np.linalg.norm(np.linspace(a, b, 10001) - centres[1 - k], axis=1)) >= radius
            for a, b in ((np.zeros(2), touch[0]), (touch[1], goal))
        )
        length = np.linalg.norm(touch[0]) + arc(centres[k], *touch, side) + np.linalg.norm(goal - touch[1])
        best = min(best, length if clear else np.inf)
    for one in (1, -1):
        for two in (1, -1):
            first, last = touching(np.zeros(2), centres[0], one), touching(goal, centres[1], -two)
            between = centres[1] - centres[0]
            d = np.linalg.norm(between)
            if one == two:
                normal = turned(between / d, one * np.pi / 2.0)
                leave, arrive = centres[0] + radius * normal, centres[1] + radius * normal
            else:
                normal = turned(between / d, one * np.arccos(2.0 * radius / d))
                leave, arrive = centres[0] + radius * normal, centres[1] - radius * normal
            length = np.linalg.norm(first) + arc(centres[0], first, leave, one) + np.linalg.norm(arrive - leave)
            length += arc(centres[1], arrive, last, two) + np.linalg.norm(goal - last)
            best = min(best, length)
    return float(best**2)


# -- calculus of variations: closed forms ------------------------------------------------------------------------------


def curve(running, first, last, horizon=1.0, *constraints):
    x, u = axis(1)
    return problem(
        x, u, (u,), Fixed(horizon), Bolza(running=running(x, u)), start(x, first), end(x, last), *constraints
    )


def great_circle():
    return curve(lambda x, u: ca.sqrt(u**2 + ca.cos(x) ** 2), 0.2, 0.9, 1.2)


def soap_film():
    return curve(lambda x, u: x * ca.sqrt(1.0 + u**2), 1.0, 1.0)


def half_plane():
    return curve(lambda x, u: ca.sqrt(1.0 + u**2) / x, 1.0, 2.0, 1.5)


def with_length(running, first, last, length, steepest=INF):
    x, u = axis(2)
    ends = along(u, -steepest, steepest), start(x, [first, 0.0]), end(x, [last, length])
    return problem(x, u, (u, ca.sqrt(1.0 + u**2)), Fixed(1.0), Bolza(running=running(x[0], u)), *ends)


def hanging_chain():
    return with_length(lambda x, u: x * ca.sqrt(1.0 + u**2), 1.0, 3.0, 4.0)


def dido():
    return with_length(lambda x, u: -x, 0.0, 0.0, 1.2, 8.0)


def root(function, low, high):
    """Return the root of a function between two arguments of different sign, by bisection."""
    for _ in range(200):
        middle = (low + high) / 2.0
        low, high = (middle, high) if function(middle) * function(low) > 0.0 else (low, middle)
    return (low + high) / 2.0


def soap_film_area():
    c = root(lambda c: c * np.cosh(0.5 / c) - 1.0, 0.6, 1.0)
    return c / 2.0 * (1.0 + c * np.sinh(1.0 / c))


def chain_energy():
    # x = c cosh((t - a)/c) + b: 4^2 - 2^2 = 4 c^2 sinh^2(1/(2 c)) by length and difference of height.
    c = root(lambda c: 2.0 * c * np.sinh(0.5 / c) - np.sqrt(12.0), 0.1, 0.5)
    a = 0.5 - c * np.arctanh(2.0 / 4.0)
    b = 1.0 - c * np.cosh(a / c)
    return b * 4.0 + c / 2.0 * (1.0 + c / 2.0 * (np.sinh(2.0 * (1.0 - a) / c) + np.sinh(2.0 * a / c)))


def dido_area():
    angle = root(lambda a: a / np.sin(a) - 1.2, 0.1, 2.0)
    radius = 0.5 / np.sin(angle)
    return -(radius**2) * (angle - np.sin(angle) * np.cos(angle))


# -- linear-quadratic: closed forms ------------------------------------------------------------------------------------


def hager():
    x, u = axis(1)
    cost = Bolza(running=(u**2 + x * u + 1.25 * x**2) / 2.0)
    return problem(x, u, (0.5 * x + u,), Fixed(1.0), cost, start(x, 1.0))


def linear_boundary_layers():
    x, u = axis(1)
    cost = Bolza(running=(x**2 + u**2) / 2.0)
    return problem(x, u, (u - x,), Fixed(10.0), cost, start(x, 1.5), end(x, 1.0))


def boundary_layers_cost():
    # x'' = 2 x, and twice the running cost is the derivative of x x' + x^2.
    r = np.sqrt(2.0)
    a, b = np.linalg.solve([[1.0, 1.0], [np.exp(10.0 * r), np.exp(-10.0 * r)]], [1.5, 1.0])
    ends = [(a * np.exp(r * t) + b * np.exp(-r * t), r * (a * np.exp(r * t) - b * np.exp(-r * t))) for t in (0.0, 10.0)]
    return (ends[1][0] * sum(ends[1]) - ends[0][0] * sum(ends[0])) / 2.0


def kirk_5_1():
    x, u = axis(2)
    rate = x[1], u - x[1]
    return problem(x, u, rate, Fixed(2.0), Bolza(running=u**2 / 2.0), start(x, 0.0), end(x, [5.0, 2.0]))


def kirk_5_1_cost():
    # 1/2 d' W^-1 d with the Gramian W = integral of e^(A s) B B' e^(A' s), e^(A s) B = (1 - e^-s, e^-s).
    t, e = 2.0, np.exp(-2.0)
    gramian = np.array([[t - 2 * (1 - e) + (1 - e**2) / 2, (1 - e) - (1 - e**2) / 2],
                        [(1 - e) - (1 - e**2) / 2, (1 - e**2) / 2]])  # fmt: skip
    d = np.array([5.0, 2.0])
    return float(d @ np.linalg.solve(gramian, d)) / 2.0


# -- regulators and reactors ------------------------------------------------------------------------------------------


def duffing():
    x, u = axis(2)
    rate = x[1], -x[0] - 0.15 * x[0] ** 3 + u
    return problem(x, u, rate, Fixed(2.0), Bolza(running=u**2 / 2.0), start(x, [0.5, -0.5]), end(x, 0.0))


def hypersensitive_value():
    """Value of the limit of a long horizon: the stable and the unstable solution of H = 0, x (sqrt(1 + x^4) -+ x^2)."""
    falling, rising = ((x2 * np.sqrt(1.0 + x2**2) + np.arcsinh(x2)) / 4.0 for x2 in (1.5**2, 1.0))
    return float(falling - 1.5**4 / 4.0 + rising + 1.0 / 4.0)


def hypersensitive():
    x, u = axis(1)
    cost = Bolza(running=(x**2 + u**2) / 2.0)
    return problem(x, u, (u - x**3,), Fixed(50.0), cost, start(x, 1.5), end(x, 1.0))


def van_der_pol(*limits):
    x, u = axis(2)
    rate = x[1], -x[0] + x[1] * (1.0 - x[0] ** 2) + u
    cost = Bolza(running=ca.sumsqr(x) + u**2)
    return problem(x, u, rate, Fixed(5.0), cost, start(x, [1.0, 0.0]), *(along(x[1], lower=low) for low in limits))


def rayleigh(mixed=False):
    x, u = axis(2)
    limits = (along(u + x[0] / 6.0, upper=0.0),) if mixed else ()
    cost = Bolza(running=x[0] ** 2 + u**2)
    return problem(x, u, rayleigh_rate(x, u), Fixed(4.5 if mixed else 2.5), cost, start(x, -5.0), *limits)


def stirred_tank():
    x, u = axis(2)
    term = (x[1] + 0.5) * ca.exp(25.0 * x[0] / (x[0] + 2.0))
    rate = -2.0 * (x[0] + 0.25) + term - (x[0] + 0.25) * u, 0.5 - x[1] - term
    cost = Bolza(running=ca.sumsqr(x) + 0.1 * u**2)
    return problem(x, u, rate, Fixed(0.78), cost, start(x, [0.05, 0.0]))


def batch_reactor():
    x, u = axis(2)
    first, second = 4000.0 * ca.exp(-2500.0 / u), 620000.0 * ca.exp(-5000.0 / u)
    rate = -first * x[0] ** 2, first * x[0] ** 2 - second * x[1]
    limits = start(x, [1.0, 0.0]), along(u, 298.0, 398.0)
    return problem(x, u, rate, Fixed(1.0), Bolza(final=-x[1]), *limits)


def catalyst():
    x, u = axis(2)
    rate = u * (10.0 * x[1] - x[0]), u * (x[0] - 10.0 * x[1]) - (1.0 - u) * x[1]
    limits = start(x, [1.0, 0.0]), along(u, 0.0, 1.0)
    return problem(x, u, rate, Fixed(1.0), Bolza(final=x[0] + x[1] - 1.0), *limits)


def jackson():
    x, u = axis(3)
    first, second = u * (x[0] - 10.0 * x[1]), (1.0 - u) * x[1]
    limits = start(x, [1.0, 0.0, 0.0]), along(u, 0.0, 1.0)
    return problem(x, u, (-first, first - second, second), Fixed(4.0), Bolza(final=-x[2]), *limits)


def fishing():
    x, u = axis(2)
    rate = x[0] - x[0] * x[1] - 0.4 * x[0] * u, -x[1] + x[0] * x[1] - 0.2 * x[1] * u
    limits = start(x, [0.5, 0.7]), along(u, 0.0, 1.0)
    return problem(x, u, rate, Fixed(12.0), Bolza(running=ca.sumsqr(x - 1.0)), *limits)


def tumour():
    """Anti-angiogenic treatment with a given amount of drug, a state of its own."""
    x, u = axis(3)
    growth, b, d, kill, mu = 0.084, 5.85, 0.00873, 0.15, 0.02
    p, q, _ = ca.vertsplit(x)
    rate = -growth * p * ca.log(p / q), q * (b - (mu + d * p ** (2.0 / 3.0) + kill * u)), u
    full = ((b - mu) / d) ** 1.5
    limits = start(x, [full / 2.0, full / 4.0, 0.0]), end(x[2], upper=15.0, lower=0.0), along(u, 0.0, 75.0)
    limits += (along(x[:2], 0.01, full),)
    return problem(x, u, rate, Free(1.0, 0.1, 1.2), Bolza(final=p), *limits)


# -- flight -----------------------------------------------------------------------------------------------------------


def moon_lander():
    x, u = axis(2)
    limits = start(x, [10.0, -2.0]), end(x, 0.0), along(u, 0.0, 3.0)
    return problem(x, u, (x[1], u - 1.5), Free(4.0), Bolza(running=u), *limits)


def moon_fuel():
    # Free fall until (2 + 1.5 t)^2 = 3 (10 - 2 t - 0.75 t^2), then full thrust.
    t = (-4.0 + np.sqrt(16.0 + 6.0 * 26.0 / 3.0)) / 3.0
    return 3.0 * (2.0 + 1.5 * t) / 1.5


def goddard(redundant=True):
    x, u = axis(3)
    h, v, m = ca.vertsplit(x)
    drag = 310.0 * v**2 * ca.exp(-500.0 * (h - 1.0))
    rate = v, (u - drag) / m - 1.0 / h**2, -2.0 * u
    limits = [start(x, [1.0, 0.0, 1.0]), end(m, 0.6), along(u, 0.0, 3.5)]
    if redundant:
        limits += [along(h, lower=1.0), along(v, lower=0.0), along(m, 0.6, 1.0)]
    return problem(x, u, rate, Free(1.0), Bolza(final=-h), *limits)


def orbit_raising():
    x, u = axis(4)
    r, w, v, t = ca.vertsplit(x)
    push = 0.1405 / (1.0 - 0.0749 * t)
    rate = w, v**2 / r - 1.0 / r**2 + push * ca.sin(u), -w * v / r + push * ca.cos(u), 1.0
    limits = start(x, [1.0, 0.0, 1.0, 0.0]), end(w, 0.0), end(v - 1.0 / ca.sqrt(r), 0.0)
    return problem(x, u, rate, Fixed(3.32), Bolza(final=-r), *limits)


def maximum_range():
    """The direction as an angle; at rest at the start, where it does not matter."""
    x, u = axis(3)
    rate = x[2] * ca.cos(u), x[2] * ca.sin(u), 0.5 - ca.sin(u)
    return problem(x, u, rate, Fixed(2.0), Bolza(final=-x[0]), start(x, 0.0), end(x[1], 0.1))


def flying_robot():
    x, u = axis(6, 4)
    first, second = u[0] - u[1], u[2] - u[3]
    rate = (
        *ca.vertsplit(x[3:]),
        (first + second) * ca.cos(x[2]),
        (first + second) * ca.sin(x[2]),
        0.2 * (first - second),
    )
    limits = start(x, [-10.0, -10.0, np.pi / 2.0, 0.0, 0.0, 0.0]), end(x, 0.0), along(u, lower=0.0)
    limits += along(u[0] + u[1], upper=1.0), along(u[2] + u[3], upper=1.0)
    return problem(x, u, rate, Fixed(12.0), Bolza(running=ca.sum1(u)), *limits)


def alp_rider():
    x, u = axis(5, 2)
    a, b, c, d, t = ca.vertsplit(x)
    rate = (
        -10 * a + u[0] + u[1],
        -2 * b + u[0] + 2 * u[1],
        -3 * c + 5 * d + u[0] - u[1],
        5 * c - 3 * d + u[0] + 3 * u[1],
    )
    alps = sum(w * ca.exp(-k * (t - at) ** 2) for w, at, k in ((3, 3, 12), (3, 6, 10), (3, 10, 6), (8, 15, 4)))
    limits = start(x, [2.0, 1.0, 2.0, 1.0, 0.0]), end(x[:4], [2.0, 3.0, 1.0, -2.0])
    limits += (along(ca.sumsqr(x[:4]) - alps, lower=0.01),)
    cost = Bolza(running=100.0 * ca.sumsqr(x[:4]) + 0.01 * ca.sumsqr(u))
    return problem(x, u, (*rate, 1.0), Fixed(20.0), cost, *limits)


def shuttle():
    """Re-entry of the space shuttle: greatest cross range, in feet, pounds and seconds; cost in degrees."""
    x, u = axis(6, 2)
    h, _, theta, v, gamma, psi = ca.vertsplit(x)
    alpha, beta = u[0], u[1]
    degrees = 180.0 / np.pi
    r, density = 20902900.0 + h, 0.002378 * ca.exp(-h / 23800.0)
    lift = -0.20704 + 0.029244 * alpha * degrees
    drag = 0.07854 - 0.61592e-2 * alpha * degrees + 0.621408e-3 * (alpha * degrees) ** 2
    mass, g = 203000.0 / 32.174, 0.14076539e17 / r**2
    force = density * v**2 * 2690.0 / 2.0 / mass
    rate = (
        v * ca.sin(gamma), v / r * ca.cos(gamma) * ca.sin(psi) / ca.cos(theta), v / r * ca.cos(gamma) * ca.cos(psi),
        -drag * force - g * ca.sin(gamma), lift * force / v * ca.cos(beta) + ca.cos(gamma) * (v / r - g / v),
        lift * force * ca.sin(beta) / (v * ca.cos(gamma)) + v / (r * ca.cos(theta)) * ca.cos(gamma) * ca.sin(psi)
        * ca.sin(theta),
    )  # fmt: skip
    limits = (start(x, [260000.0, 0.0, 0.0, 25600.0, -1.0 / degrees, np.pi / 2.0]),)
    limits += end(ca.vertcat(h, v, gamma), [80000.0, 2500.0, -5.0 / degrees]), along(h, lower=0.0), along(v, lower=1.0)
    limits += along(theta, -1.55, 1.55), along(gamma, -1.55, 1.55)
    limits += (along(u, [-np.pi / 2.0, -89.0 / degrees], [np.pi / 2.0, 1.0 / degrees]),)
    return problem(x, u, rate, Free(1000.0, 100.0, 4000.0), Bolza(final=-theta * degrees), *limits)


def two_masses_with_dry_friction():
    """Two masses and two springs with dry friction, smoothed as v / sqrt(v^2 + 0.01^2), both at speed."""
    x, u = axis(4, 2)
    q1, v1, q2, v2 = ca.vertsplit(x)

    def sign(v):
        return v / ca.sqrt(v**2 + 0.01**2)

    rate = v1, (-1.8 * q1 + 0.85 * q2 - sign(v1) + u[0]) / 1.1, v2, (0.85 * (q1 - q2) - sign(v2) + u[1]) / 1.2
    limits = start(x, [0.0, -1.0, 0.0, -2.0]), end(x, [1.0, 0.0, 2.0, 0.0]), along(u, -4.0, 4.0)
    return problem(x, u, rate, Free(2.0), TIME, *limits)


def protein():
    """Induced foreign protein production by bacteria: volume, cells, nutrient, protein, inducer, shock, recovery."""
    x, u = axis(7, 2)
    volume, cells, nutrient, product, inducer, shock, recovery = ca.vertsplit(x)
    k = 0.09 * inducer / (0.034 + inducer)
    saturated = nutrient / (14.35 + nutrient * (1.0 + nutrient / 111.5))
    growth = saturated * (shock + 0.22 * recovery / (0.22 + inducer))
    made = 0.233 * saturated * (0.0005 + inducer) / (0.022 + inducer)
    feed = u[0] + u[1]
    rate = (
        feed, growth * cells - feed / volume * cells,
        100.0 * u[0] / volume - feed / volume * nutrient - growth * cells / 0.51,
        made * cells - feed / volume * product,
        4.0 * u[1] / volume - feed / volume * inducer, -k * shock, k * (1.0 - recovery),
    )  # fmt: skip
    limits = start(x, [1.0, 0.1, 40.0, 0.0, 0.0, 1.0, 0.0]), along(u, 0.0, 1.0)
    return problem(x, u, rate, Fixed(10.0), Bolza(final=-volume * product), *limits)


def robbins():
    x, u = axis(3)
    limits = start(x, [1.0, -2.0, 0.0]), end(x, [0.0, 0.0, 0.0]), along(x[0], lower=0.0)
    cost = Bolza(running=3.0 * x[0] + 0.5 * u**2)
    return problem(x, u, (x[1], x[2], u), Fixed(10.0), cost, *limits)


def known(make):
    return lambda: make().problem


PUBLISHED = {
    "brachistochrone": Published(known(problems.brachistochrone), 1.8016031224530813, 5e-15, problems.DYMOS),
    "oscillator in least time": Published(oscillator, np.pi, 0.0, f"{KIRK}, 5.4; half a turn about (1, 0)"),
    "double integrator from (1, 1)": Published(double_integrator, 1 + 2 * np.sqrt(1.5), 0.0, f"{KIRK}, 5.4"),
    "double integrator, two axes": Published(known(problems.double_integrator_2d), 20.0, 0.0, problems.DYMOS),
    "van der Pol in least time": Published(van_der_pol_fastest, 2.86419188, 5e-8, "H. Maurer, N. P. Osmolovskii, 2004"),
    "Rayleigh in least time": Published(rayleigh_fastest, 3.66817339, 5e-8, "H. Maurer, N. P. Osmolovskii, 2004"),
    "F-8 aircraft": Published(f8, 3.78085577468, 5e-12, f"{MINTOC}; digits by shooting", (5.72864576,)),
    "Zermelo": Published(zermelo, 5.45786526356, 5e-12, f"{BRYSON}, 2.7; digits by shooting"),
    "linear tangent steering": Published(tangent_steering, 0.55457087833, 5e-12, f"{COPS}; {BETTS}; by its law"),
    "Dubins' car": Published(dubins, dubins_length(), 0.0, "L. E. Dubins, 1957: arcs and tangents"),
    "past two discs": Published(discs, discs_cost(), 0.0, f"{PSOPT}; taut string"),
    "COPS robot arm": Published(known(problems.cops), 9.140911745908168, 5e-13, COPS),
    "two-link arm": Published(known(problems.two_link), 2.98227994254784, 5e-13, f"{LUUS}; digits by shooting"),
    "great circle": Published(
        great_circle, float(np.arccos(np.sin(0.2) * np.sin(0.9) + np.cos(0.2) * np.cos(0.9) * np.cos(1.2))), 0.0, BRYSON
    ),
    "soap film": Published(soap_film, soap_film_area(), 0.0, f"{BRYSON}; catenary"),
    "geodesic of the half plane": Published(half_plane, float(np.arccosh(1 + (1.5**2 + 1) / 4)), 0.0, "Poincare"),
    "hanging chain": Published(hanging_chain, float(chain_energy()), 0.0, f"{COPS}; catenary"),
    "Dido": Published(dido, float(dido_area()), 0.0, f"{BRYSON}; arc of a circle"),
    "Hager": Published(hager, float(np.exp(2) * np.sinh(2) / (1 + np.exp(2)) ** 2), 0.0, "W. W. Hager, 2000"),
    "linear boundary layers": Published(linear_boundary_layers, boundary_layers_cost(), 0.0, problems.DYMOS),
    "Kirk 5.1-1": Published(kirk_5_1, kirk_5_1_cost(), 0.0, f"{KIRK}; Gramian"),
    "lift, least effort": Published(
        known(lambda: problems.lift_cheapest(0.8)), problems.lift_cheapest(0.8).cost, 0.0, "elementary"
    ),
    "lift with a speed limit": Published(
        known(lambda: problems.lift_fastest(speed=1.2)), problems.lift_fastest(speed=1.2).cost, 0.0, "elementary"
    ),
    "Duffing oscillator": Published(
        duffing, 0.187444856136, 5e-13, "R. Van Dooren, J. Vlassenbroeck, 1982; digits by shooting"
    ),
    "hypersensitive": Published(hypersensitive, hypersensitive_value(), 0.0, f"{PSOPT}; elementary"),
    "van der Pol": Published(van_der_pol, 2.866952422563, 5e-13, "PROPT manual prints 2.8666; digits by shooting"),
    "van der Pol with a state limit": Published(lambda: van_der_pol(-0.4), 2.95370134239, 5e-12, MAURER),
    "Rayleigh": Published(rayleigh, 29.3760796559, 5e-11, "D. H. Jacobson, D. Q. Mayne, 1970; digits by shooting"),
    "Rayleigh with a mixed limit": Published(lambda: rayleigh(True), 44.80444490836, 5e-12, MAURER),
    "stirred tank": Published(stirred_tank, 0.026603355460, 5e-13, f"{KIRK}, 6.2; digits by shooting"),
    "batch reactor": Published(
        batch_reactor, -0.6108029205537, 5e-13, f"W. H. Ray, 1981; {PSOPT} prints 0.610775; by shooting"
    ),
    "catalyst mixing": Published(catalyst, -0.0480556858609, 5e-14, f"{COPS}; digits by shooting"),
    "Jackson": Published(jackson, -0.191814356325, 5e-13, f"R. Jackson, 1968; {MINTOC}; digits by shooting"),
    "fishing": Published(fishing, 1.3440811981, 5e-11, f"{MINTOC}, relaxed; digits by shooting"),
    "tumour": Published(tumour, 7571.67, 5e-2, f"U. Ledzewicz, H. Schaettler, 2007; {PSOPT}"),
    "singular regulator": Published(
        lambda: problems.regulator()[0], problems.regulator()[3], 0.0, "Aly, 1978; elementary"
    ),
    "Bryson-Denham, arc": Published(known(lambda: problems.bryson_denham(0.1)), 4 / 0.9, 0.0, BRYSON),
    "Bryson-Denham, touch": Published(known(lambda: problems.bryson_denham(0.2)), 2 + 6 * 0.04, 0.0, BRYSON),
    "Bryson-Denham, free": Published(known(lambda: problems.bryson_denham(0.3)), 2.0, 0.0, BRYSON),
    "container crane": Published(
        known(problems.crane), 0.037519461375, 2e-12, f"Augustin, Maurer; {problems.MAPTOR}; digits of two schemes"
    ),
    "cart-pole": Published(
        known(problems.cart_pole), 57.94478030673, 5e-12, "M. Kelly, 2017: 58.8; both by shooting", (58.80766745817,)
    ),
    "moon lander": Published(moon_lander, moon_fuel(), 0.0, "J. S. Meditch, 1964; elementary"),
    "Goddard rocket": Published(goddard, -1.0128369183175, 5e-14, f"{COPS}; digits by shooting"),
    "Goddard, no redundant limits": Published(lambda: goddard(False), -1.0128369183175, 5e-14, COPS),
    "orbit raising": Published(orbit_raising, -1.52527770065, 5e-12, f"{BRYSON}, 2.5; digits by shooting"),
    "maximum range": Published(maximum_range, -1.71231487508, 5e-12, f"{BRYSON}, {PSOPT}; digits by shooting"),
    "flying robot": Published(flying_robot, 7.910154646, 5e-9, f"Y. Sakawa, 1999; {BETTS}"),
    "alp rider": Published(alp_rider, 2030.85609, 5e-6, BETTS),
    "two masses with dry friction": Published(
        two_masses_with_dry_friction, 2.11414463, 5e-9, f"B. J. Driessen, N. Sadegh, 2000; {PSOPT}: 2.1050; by shooting"
    ),
    "protein production": Published(
        protein, -6.15160, 5e-6, "J. Lee, W. F. Ramirez, 1994; PROPT manual prints 6.164; best of five starts"
    ),
    "Robbins": Published(robbins, 19.43178, 5e-6, "H. M. Robbins, 1980; digits by a convex QP of 4000 elements"),
    "shuttle re-entry": Published(shuttle, -34.1412, 5e-5, BETTS),
}
