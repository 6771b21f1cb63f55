"""The fastest motion of the spherical machine by shooting over its arcs; shares nothing with ocp or models.

The equations of motion come from the metric of `hard_cases.reference`, the integrator is the classical Runge-Kutta
method, extrapolated once, and the optimum and its derivatives come from the KKT conditions of the arc durations.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from hard_cases.reference import GRAVITY, sphere_metric, sphere_weight

STEPS = 8  # of order 4 over half an arc; the extrapolation from 8 and 16 steps is of order 5
Q0, Q1 = (0.9, 0.0, 0.0, 0.85), (1.6, 2.0, 0.5, 0.9)
NEAREST = 0.6  # lower limit of r [m]
RADIAL = 3  # number of the coordinate r


@dataclass(frozen=True)
class Derivatives:
    """Durations of the arcs of the fastest motion, and derivatives by the parameters.

    Args:
        durations: (K,) [s].
        slopes: (K, np) derivatives of the durations [s/unit].
        holding: (H, np) derivatives of the force that holds r, in the middle of each arc that holds it [N/unit].
    """

    durations: np.ndarray
    slopes: np.ndarray
    holding: np.ndarray


def shoot(numbers, names, sides, guess):
    """Return the fastest motion with these arcs and its derivatives by parameters.

    Args:
        numbers: name -> value of the parameters of the machine, "viscous.c" and the limits "limit_1" .. "limit_4".
        names: of the parameters by which derivatives are wanted.
        sides: for each arc (K, 4) -1 or 1, the limit at which each drive is; 0 where the drive of r holds r at NEAREST.
        guess: (K,) durations [s].
    """
    theta, d = ca.MX.sym("theta", len(names)), ca.MX.sym("d", len(guess))
    x, conditions, forces = ca.MX(ca.DM([*Q0, 0, 0, 0, 0])), [], []
    for k, side in enumerate(sides):
        held = side[RADIAL] == 0
        if held and sides[k - 1][RADIAL] != 0:
            conditions += [x[RADIAL] - NEAREST, x[4 + RADIAL]]
        moved, force = _equations(numbers, names, side)
        half = moved(x, d[k] / 2, theta)
        forces += [force(half, theta)] if held else []
        x = moved(half, d[k] / 2, theta)
    conditions = ca.vertcat(*conditions, x - ca.DM([*Q1, 0, 0, 0, 0]))
    lam = ca.MX.sym("lam", conditions.numel())
    unknown = ca.vertcat(d, lam)
    kkt = ca.vertcat(ca.gradient(ca.sum1(d) + ca.dot(lam, conditions), d), conditions)
    values = [numbers[name] for name in names]
    evaluate = ca.Function("kkt", [unknown, theta], [kkt, ca.jacobian(kkt, unknown), ca.jacobian(kkt, theta)])
    slope = ca.Function("slope", [d, theta], [ca.jacobian(conditions, d)])(guess, values).full()
    z = np.concatenate([guess, -np.linalg.lstsq(slope.T, np.ones(len(guess)), rcond=None)[0]])
    for _ in range(8):
        residual, jacobian, moved = (part.full() for part in evaluate(z, values))
        z = z - np.linalg.solve(jacobian, residual).ravel()
    assert np.max(np.abs(np.linalg.solve(jacobian, residual)[: len(guess)])) < 1e-12
    slopes = -np.linalg.solve(jacobian, moved)[: len(guess)]
    parts = ca.vertcat(*forces)
    total = ca.Function("forces", [d, theta], [ca.jacobian(parts, d), ca.jacobian(parts, theta)])
    by_d, by_theta = (part.full() for part in total(z[: len(guess)], values))
    return Derivatives(z[: len(guess)], slopes, by_d @ slopes + by_theta)


def _equations(numbers, names, side):
    """Return (state, duration, theta) -> state after the duration, and (state, theta) -> force of the drive of r."""
    q, v, theta = ca.SX.sym("q", 4), ca.SX.sym("v", 4), ca.SX.sym("theta", len(names))
    data = {**numbers, **dict(zip(names, ca.vertsplit(theta), strict=True))}
    metric = ca.vertcat(*(ca.horzcat(*row) for row in sphere_metric(ca, data, ca.vertsplit(q))))
    weight = GRAVITY * sphere_weight(ca, data, ca.vertsplit(q))
    p = metric @ v
    bias = ca.jtimes(p, q, v) - ca.gradient(ca.dot(v, p) / 2 - weight, q) + data["viscous.c"] * v
    tau = ca.vertcat(*(side[i] * data[f"limit_{i + 1}"] for i in range(4)))
    if side[RADIAL]:
        a = ca.solve(metric, tau - bias)
    else:  # r'' = 0, whatever force that takes
        a = ca.vertcat(ca.solve(metric[:RADIAL, :RADIAL], (tau - bias)[:RADIAL]), 0)
    x = ca.vertcat(q, v)
    rate = ca.Function("rate", [x, theta], [ca.vertcat(v, a)])

    h = ca.SX.sym("h")
    k1 = rate(x, theta)
    k2 = rate(x + h / 2 * k1, theta)
    k3 = rate(x + h / 2 * k2, theta)
    k4 = rate(x + h * k3, theta)
    step = ca.Function("step", [x, h, theta], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])

    def after(n):
        start, duration, given = ca.MX.sym("x", 8), ca.MX.sym("duration"), ca.MX.sym("theta", len(names))
        end = start
        for _ in range(n):
            end = step(end, duration / n, given)
        return ca.Function("after", [start, duration, given], [end])

    few, many = after(STEPS), after(2 * STEPS)
    force = ca.Function("force", [x, theta], [(metric @ a + bias)[RADIAL]])
    return (lambda at, d, given: (16 * many(at, d, given) - few(at, d, given)) / 15), force
