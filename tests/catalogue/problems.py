"""Optimal-control problems whose optimum is known, each with a reference for its number."""

from dataclasses import dataclass
from math import cosh, inf, pi, sinh, sqrt, tanh

import casadi as ca
import numpy as np

from models import cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import hamel
from ocp import Bolza, Fixed, Free, Guess, Problem, System, along, end, start

DYMOS = "https://github.com/OpenMDAO/dymos at 5bfbe394, dymos/examples"
MAPTOR = "https://github.com/ChenDavidTimothy/TrajectoLab_radau at 1d0f1236"
G = 9.81


@dataclass(frozen=True, eq=False)
class Known:
    name: str
    problem: Problem
    cost: float
    source: str
    switches: tuple[tuple[float, ...], ...] = ()  # for each control, the times of its changes of sign [s]
    guess: Guess | None = None  # where the default one does not lead to the optimum


def system(x, u, rate, **signals):
    return System(x, u, ca.SX(0, 1), rate, {"x": x, "u": u, **signals})


def cops():
    """No mechanics: the terms with the rate of I are dropped, as COPS does."""
    x, u, length = ca.SX.sym("x", 6), ca.SX.sym("u", 3), 5.0
    rho, phi = x[0], x[2]
    inertia = ((length - rho) ** 3 + rho**3) / 3
    rate = ca.vertcat(x[3:], u[0] / length, u[1] / (inertia * ca.sin(phi) ** 2), u[2] / inertia)
    optimum = 9.140911745908168
    return Known(
        "COPS robot arm",
        _cops_task(system(x, u, rate, q=x[:3], v=x[3:])),
        optimum,
        "COPS; https://github.com/MadNLP/COPSBenchmark.jl; 9.14138 on 200 intervals in https://github.com/OpenMDAO/dymos,"
        " examples/robot_arm; digits by switching-time optimisation with order-12 Gauss collocation",
        ((optimum / 4, 3 * optimum / 4), (optimum / 2,), (2.796043210014, 6.344868535907)),
    )


def cops_with_inertial_terms():
    """The same arm from its Lagrangian 1/2 (L rho'^2 + I phi'^2 + I sin(phi)^2 theta'^2), as a problem."""
    x, u, length = ca.SX.sym("x", 6), ca.SX.sym("u", 3), 5.0
    (rho, _, phi), (drho, dtheta, dphi) = ca.vertsplit(x[:3]), ca.vertsplit(x[3:])
    inertia = ((length - rho) ** 3 + rho**3) / 3
    slope = rho**2 - (length - rho) ** 2
    s, c = ca.sin(phi), ca.cos(phi)
    rate = ca.vertcat(
        x[3:],
        (u[0] + slope * (dphi**2 + (s * dtheta) ** 2) / 2) / length,
        (u[1] - (slope * drho * s**2 + 2 * inertia * s * c * dphi) * dtheta) / (inertia * s**2),
        (u[2] - slope * drho * dphi + inertia * s * c * dtheta**2) / inertia,
    )
    return _cops_task(system(x, u, rate, q=x[:3], v=x[3:]))


def _cops_task(arm):
    q, v, u = arm["q"], arm["v"], arm["u"]
    ends = start(q, [4.5, 0, pi / 4]), start(v, 0), end(q, [4.5, 2 * pi / 3, pi / 4]), end(v, 0)
    limits = along(q, [0, -pi, 0], [5, pi, pi]), along(u, -1, 1)
    return Problem(arm, Free(5.0), Bolza(time=1.0), (*ends, *limits))


def two_link(misprinted=False):
    """Luus's arm in absolute rates; `misprinted` puts two brackets where the listing of ICLOCS2 has them."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    w1, w2, q2, _ = ca.vertsplit(x)
    s, c = ca.sin(q2), ca.cos(q2)
    first, second = s * (9 / 4 * c * w1**2 + 2 * w2**2), s * (7 / 2 * w1**2 + 9 / 4 * c * w2**2)
    if misprinted:
        first, second = s * (9 / 4 * c * w1**2) + 2 * w2**2, s * (9 / 4 * c * w2**2) + 7 / 2 * w1**2
    d = 31 / 36 + 9 / 4 * s**2
    acceleration1 = (first + 4 / 3 * (u[0] - u[1]) - 3 / 2 * c * u[1]) / d
    acceleration2 = -(second - 7 / 3 * u[1] + 3 / 2 * c * (u[0] - u[1])) / d
    ends = start(x, [0, 0, 0.5, 0]), end(x, [0, 0, 0.5, 0.522])
    arm = system(x, u, ca.vertcat(acceleration1, acceleration2, w2 - w1, w1))
    problem = Problem(arm, Free(3.0), Bolza(time=1.0), (*ends, along(u, -1, 1)))
    if misprinted:
        return Known("two-link arm, misprinted", problem, 2.9462, "listing of ICLOCS2, TwoLinkRobotArm")
    return Known(
        "two-link arm",
        problem,
        2.98227994254784,
        "http://tomdyn.com/examples/twoLinkRoboticArm.html (2.983364855 on 30 nodes, from above); digits by "
        "switching-time optimisation with order-12 Gauss collocation",
        ((1.491139971274,), (0.943140354863, 2.627545066759)),
    )


def bryson_denham(limit):
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    bounce = start(x, [0, 1]), end(x, [0, -1])
    axis = system(x, u, ca.vertcat(x[1], u))
    problem = Problem(axis, Fixed(1.0), Bolza(running=u**2 / 2), (*bounce, along(x[0], upper=limit)))
    cost = 4 / (9 * limit) if limit <= 1 / 6 else 2 + 6 * (1 - 4 * min(limit, 1 / 4)) ** 2
    return Known(f"Bryson-Denham, l = {limit}", problem, cost, f"Breakwell, Bryson, Denham; {DYMOS}")


def regulator(horizon=5.0):
    """min 1/2 int x_1^2 + x_2^2, x_1'' = u, |u| <= 1: u = -1, then singular with u = x_1 = size cosh(T - t).

    Returned with the switching time, where x_2 = -x_1 tanh(T - t), the size and the cost; elementary.
    """
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    axis = system(x, u, ca.vertcat(x[1], u))
    problem = Problem(axis, Fixed(horizon), Bolza(running=ca.sumsqr(x) / 2), (start(x, [0, 1]), along(u, -1, 1)))
    low, high = 1.0, 2.0
    for _ in range(60):
        t = (low + high) / 2
        low, high = (t, high) if 1 - t > -(t - t**2 / 2) * tanh(horizon - t) else (low, t)
    size = (t - t**2 / 2) / cosh(horizon - t)
    bang = (t**3 / 3 - t**4 / 4 + t**5 / 20 + (1 - (1 - t) ** 3) / 3) / 2
    return problem, t, size, bang + size**2 * sinh(2 * (horizon - t)) / 4


def brachistochrone():
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u")
    bead = system(x, u, ca.vertcat(x[2] * ca.sin(u), -x[2] * ca.cos(u), 9.80665 * ca.cos(u)))
    conditions = start(x, [0, 10, 0]), end(x[:2], [10, 5]), along(u, 0, pi)
    # T = sqrt(R/g) a on the cycloid 10 = R (a - sin a), 5 = R (1 - cos a).
    cycloid = 1.8016031224530813
    return Known(
        "brachistochrone", Problem(bead, Free(1.0), Bolza(time=1.0), conditions), cycloid, f"1.8016 in {DYMOS}"
    )


def double_integrator_2d():
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    conditions = start(x, 0), end(x, [-100, 100, 0, 0]), along(u, -1, 1)
    problem = Problem(system(x, u, ca.vertcat(x[2:], u)), Free(1.0), Bolza(time=1.0), conditions)
    return Known("double integrator", problem, 20.0, f"2 sqrt(100); {DYMOS}", ((10.0,), (10.0,)))


def crane():
    x, u = ca.SX.sym("x", 6), ca.SX.sym("u", 2)
    swing = -(u[0] + 27.0756 * x[2] + 2 * x[4] * x[5]) / x[1]
    trolley = system(x, u, ca.vertcat(x[3:], u[0] + 17.2656 * x[2], u[1], swing))
    ends = start(x, [0, 22, 0, 0, -1, 0]), end(x, [10, 14, 0, 2.5, 0, 0])
    limits = along(u, [-2.83374, -0.80865], [2.83374, 0.71265]), along(x[3:5], [-2.5, -1], [2.5, 1])
    cost = Bolza(running=(x[2] ** 2 + x[5] ** 2 + 0.01 * ca.sumsqr(u)) / 2)
    return Known(
        "container crane",
        Problem(trolley, Fixed(9.0), cost, (*ends, *limits)),
        0.0375195,
        f"Augustin, Maurer; {MAPTOR}",
    )


def cart_pole():
    x, u = ca.SX.sym("x", 4), ca.SX.sym("F")
    cart, pole, length = 1.0, 0.3, 0.5
    s, c, w = ca.sin(x[1]), ca.cos(x[1]), x[3]
    d = cart + pole * s**2
    push = (length * pole * s * w**2 + u + pole * G * c * s) / d
    turn = -(length * pole * c * s * w**2 + u * c + (cart + pole) * G * s) / (length * d)
    ends = start(x, 0), end(x, [1, pi, 0, 0])
    limits = along(u, -20, 20), along(x[0], -2, 2)
    problem = Problem(system(x, u, ca.vertcat(x[2:], push, turn)), Fixed(2.0), Bolza(running=u**2), (*ends, *limits))
    source = f"Kelly, SIAM Review 59 (2017); {DYMOS}: 58.8839 with F(T) = 0, to 1e-3; digits by Radau 3 on 200"
    return Known("cart-pole", problem, 58.80768, source)


def lift_fastest(up=True, g=G, speed=inf, mass=3.0, force=60.0, distance=0.8):
    """Rest to rest in minimum time, z'' = u/m - g; the drive brakes with the weight when it lifts."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    faster, slower = force / mass - g, force / mass + g
    if not up:
        faster, slower = slower, faster
    way = distance if up else -distance
    conditions = start(x, 0), end(x, [way, 0]), along(x[1], -speed, speed), along(u, -force, force)
    problem = Problem(system(x, u, ca.vertcat(x[1], u / mass - g)), Free(1.0), Bolza(time=1.0), conditions)
    both = 1 / faster + 1 / slower
    top = sqrt(2 * distance / both)  # speed without a limit on it
    optimum = 2 * distance / top if top <= speed else distance / speed + speed / 2 * both
    name = f"lift, {'up' if up else 'down'}, g = {g}, |v| <= {speed}"
    # Down at the limit of speed the drive carries the weight, as when it brakes: no change of sign after the first.
    last = optimum - min(top, speed) / slower if up or top <= speed else speed / faster
    return Known(name, problem, optimum, "elementary: areas under v(t)", ((last,),))


def lift_cheapest(duration=None, mass=3.0, distance=0.8):
    """Rest to rest with min integral u^2 over a fixed or a free duration."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    axis = system(x, u, ca.vertcat(x[1], u / mass - G))
    horizon = Free(1.0) if duration is None else Fixed(duration)
    t = sqrt(6 * distance / G) if duration is None else duration
    problem = Problem(axis, horizon, Bolza(running=u**2), (start(x, 0), end(x, [distance, 0])))
    cost = 12 * (mass * distance) ** 2 / t**3 + (mass * G) ** 2 * t
    return Known(
        f"lift, min int u^2, T {'free' if duration is None else t}", problem, cost, "elementary: u linear in t"
    )


def lift_compromise(eps=1e-3, mass=3.0, distance=0.8):
    """Min T + eps int u^2 without weight: T^4 = 36 eps (m d)^2."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    axis = system(x, u, ca.vertcat(x[1], u / mass))
    problem = Problem(axis, Free(1.0), Bolza(time=1.0, running=eps * u**2), (start(x, 0), end(x, [distance, 0])))
    return Known("lift, time and effort", problem, 4 / 3 * sqrt(6 * distance * mass * sqrt(eps)), "elementary")


# Coordinates that move the mass, from, to, and the cost of energy and time as printed in the derivation below.
MASSLESS = {
    "cylindrical": ([0, 1, 2], [0, 0.2, 1.0], [1.2, 0.5, 0.6], 490.1324659619, 0.7330509013),
    "spherical": ([0, 1, 3], [pi / 2 + 0.3, 0, 0, 0.9], [pi / 2 - 0.5, 1.1, 0, 0.7], 489.6930762671, 0.7301785281),
    "torus": ([0, 1, 2], [0, 0.9, -1.4], [1, 0.5, -1], 483.5248056321, 0.6857184293),
}


def straight_line(name, fastest=False, form=hamel, mass=2.0, force=15.0, duration=1.2):
    """A mass on massless links: with the force f = J^-T tau on it as cost or limit, it runs straight, d apart.

    min int |f|^2 = 12 m^2 d^2/T^3 + m^2 g^2 T; min time with |f - m g e_3| <= U: 2 sqrt(m d/U). All terms of the
    coordinates stay in the equations. The links have no inertia at all, which no form minds away from singular
    configurations; the spin of the spherical machine keeps one and its drive is held at zero.
    """
    none = {
        "cylindrical": dict(A=0, m_2=0, Theta_1_33=0, Theta_2_33=0, Theta_3_33=0),
        "spherical": dict(
            s_2=0, m_2=0, Theta_1_33=0, Theta_2_11=0, Theta_2_22=0, Theta_2_33=0, Theta_3_11=0, Theta_3_33=1
        ),
        "torus": dict(L_2=0.6, L_3=1.0, B=0, m_2=0, Theta_1_33=0)
        | {f"Theta_{k}_{i}{i}": 0 for k in (2, 3) for i in (1, 2, 3)},
    }[name]
    make = {"cylindrical": cylindrical, "spherical": spherical, "torus": torus}[name]
    arm = form(make(**none, m_3=mass, l_T=0, physical=False), [Gravity(G)])
    moving, q0, q1, energy, time = MASSLESS[name]
    q, v, tau = arm["q"], arm["v"], arm["tau"]
    f = ca.inv(ca.jacobian(arm["tool"], q[moving])).T @ tau[moving]
    held = [along(tau[i], 0, 0) for i in range(len(q0)) if i not in moving]
    conditions = start(q, q0), start(v, 0), end(q[moving], np.array(q1)[moving]), end(v[moving], 0), *held
    if fastest:
        limit = along(ca.sumsqr(f - ca.DM([0, 0, mass * G])), upper=force**2)
        problem = Problem(arm, Free(1.0), Bolza(time=1.0), (*conditions, limit))
    else:
        problem = Problem(arm, Fixed(duration), Bolza(running=ca.sumsqr(f)), conditions)
    rest = np.zeros(arm.x.numel() - len(q0))
    line = np.array([[*q0, *rest], [*q1, *rest]], dtype=float)
    # At rest and without forces: the least-time cases, with no limit on any single drive, do not converge from the
    # smooth default within its iterations.
    guess = Guess(np.array([0.0, 1.0]), line, np.zeros((2, len(q0))), duration, np.zeros(0))
    return Known(f"straight line, {name}", problem, time if fastest else energy, "elementary", guess=guess)
