"""Accelerations in extended precision, from the metrics in closed form; shares nothing with the models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

DIGITS = 60
STEP = "1e-20"  # of central differences: 40 digits of a derivative
GRAVITY = 9.81

Metric = Callable[[Any, Mapping[str, Any], Sequence[Any]], list[list[Any]]]
Weight = Callable[[Any, Mapping[str, Any], Sequence[Any]], Any]


def cylinder_metric(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> list[list[Any]]:
    """Return g(q) of the manipulator in cylindrical coordinates (equations, section 2)."""
    own = n["Theta_1_33"] + n["Theta_2_33"] + n["Theta_3_33"] + n["m_2"] * n["A"] ** 2 / 4
    mixed = n["m_3"] * n["A"]
    theta = own + n["m_3"] * q[2] ** 2 + n["m_3"] * n["A"] ** 2
    return [[theta, 0, mixed], [0, n["m_2"] + n["m_3"], 0], [mixed, 0, n["m_3"]]]


def cylinder_weight(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> Any:
    """Return U(q) / g."""
    return (n["m_2"] + n["m_3"]) * q[1]


def sphere_metric(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> list[list[Any]]:
    """Return g(q) of the manipulator in spherical coordinates, Theta_3_11 = Theta_3_22 (section 3)."""
    s, c, spin = mp.sin(q[0]), mp.cos(q[0]), n["Theta_3_33"]
    own = n["m_2"] * n["s_2"] ** 2 + n["m_3"] * q[3] ** 2 + n["Theta_3_11"]
    upright = own + n["Theta_2_22"] + n["Theta_1_33"]
    axial = n["Theta_1_33"] + n["Theta_2_33"] + spin
    turning = upright * s**2 + axial * c**2
    return [
        [own + n["Theta_2_11"], 0, 0, 0],
        [0, turning, spin * c, 0],
        [0, spin * c, spin, 0],
        [0, 0, 0, n["m_3"]],
    ]


def sphere_weight(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> Any:
    """Return U(q) / g."""
    return (n["m_2"] * n["s_2"] + n["m_3"] * q[3]) * mp.cos(q[0])


def torus_metric(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> list[list[Any]]:
    """Return g(q) of the manipulator in torus-like coordinates with diagonal inertia tensors (section 5)."""
    m2, m3, l2, l3, b = (n[name] for name in ("m_2", "m_3", "L_2", "L_3", "B"))
    c2, c23 = mp.cos(q[1]), mp.cos(q[1] + q[2])
    half = m3 * l2 * l3 * mp.cos(q[2]) / 2
    i2, i3 = n["Theta_2_22"] + m2 * l2**2 / 4 + m3 * l2**2, n["Theta_3_22"] + m3 * l3**2 / 4
    b1 = n["Theta_1_33"] + n["Theta_2_11"] + n["Theta_3_11"] + (m2 + m3) * b**2
    b2 = n["Theta_2_33"] - n["Theta_2_11"] + m2 * l2**2 / 4 + m3 * l2**2
    b3 = n["Theta_3_33"] - n["Theta_3_11"] + m3 * l3**2 / 4
    g11 = b1 + b2 * c2**2 + b3 * c23**2 + m3 * l2 * l3 * c2 * c23
    t2, t3 = (m2 / 2 + m3) * b * l2 * mp.sin(q[1]), m3 / 2 * b * l3 * mp.sin(q[1] + q[2])
    return [[g11, t2 + t3, t3], [t2 + t3, i2 + i3 + 2 * half, i3 + half], [t3, i3 + half, i3]]


def torus_weight(mp: Any, n: Mapping[str, Any], q: Sequence[Any]) -> Any:
    """Return U(q) / g."""
    upper = (n["m_2"] / 2 + n["m_3"]) * n["L_2"] * mp.sin(q[1])
    return upper + n["m_3"] / 2 * n["L_3"] * mp.sin(q[1] + q[2])


EQUATIONS: Mapping[str, tuple[Metric, Weight]] = {
    "cylindrical": (cylinder_metric, cylinder_weight),
    "spherical": (sphere_metric, sphere_weight),
    "torus": (torus_metric, torus_weight),
}


def accelerations(
    name: str, nominal: Mapping[str, float], q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return d^2 q / dt^2 (n,) of the Lagrange equations with gravity to 16 digits, and their condition numbers (n,).

    g a = tau - dU/dq - (dg/dt) v + 1/2 d(v' g v)/dq, with derivatives by central differences of 60-digit numbers. The
    condition number of a component is the sum of its relative changes over the relative changes of all data: the
    positions, velocities, torques and parameters.

    Args:
        name: of the machine.
        nominal: its parameters.
        q, v, tau: (n,).
    """
    from mpmath import mp  # optional: the package does not need it

    with mp.workdps(DIGITS):
        data = {**{key: mp.mpf(value) for key, value in nominal.items()}}
        state = [[mp.mpf(float(x)) for x in column] for column in (q, v, tau)]
        exact = _solve(mp, name, data, state)
        change = mp.mpf(STEP)
        total = [mp.mpf(0) for _ in exact]

        def add(moved: list[Any]) -> None:
            for i, (a, b) in enumerate(zip(moved, exact, strict=True)):
                total[i] += abs(a - b) / (abs(b) * change) if b else mp.mpf(0)

        for key, value in data.items():
            if value:
                add(_solve(mp, name, {**data, key: value * (1 + change)}, state))
        for k, column in enumerate(state):
            for i, value in enumerate(column):
                if value:
                    moved = [list(part) for part in state]
                    moved[k][i] = value * (1 + change)
                    add(_solve(mp, name, data, moved))
        return np.array([float(a) for a in exact]), np.array([float(max(c, 1)) for c in total])


def _solve(mp: Any, name: str, n: Mapping[str, Any], state: list[list[Any]]) -> list[Any]:
    metric, weight = EQUATIONS[name]
    q, v, tau = state
    size, h = len(q), mp.mpf(STEP)
    force = list(tau)
    for i in range(size):
        up, down = list(q), list(q)
        up[i] += h
        down[i] -= h
        one, other = metric(mp, n, up), metric(mp, n, down)
        slope = [[(a - b) / (2 * h) for a, b in zip(x, y, strict=True)] for x, y in zip(one, other, strict=True)]
        moved = [sum(slope[a][b] * v[b] for b in range(size)) for a in range(size)]
        force[i] += sum(v[a] * moved[a] for a in range(size)) / 2
        force[i] -= mp.mpf(GRAVITY) * (weight(mp, n, up) - weight(mp, n, down)) / (2 * h)
        force = [force[a] - v[i] * moved[a] for a in range(size)]
    return list(mp.lu_solve(mp.matrix(metric(mp, n, q)), mp.matrix(force)))
