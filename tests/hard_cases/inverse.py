"""Inverse dynamics against extended precision: huge accelerations, near-singular poses, ratios of masses, noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from hard_cases.case import Case, Figure
from models import Manipulator, Motion, inverse_dynamics, spherical, torus
from models.effects import Gravity
from ocp.checks import Array

EPS = float(np.finfo(float).eps)
DIGITS = 60
G = 9.81
# The number of operations behind a torque is below two hundred; rounding of each counts once.
OPERATIONS = 2e2
STATES = 20


def sphere_terms(mp: Any, machine: Manipulator, q: Array, v: Array, a: Array) -> list[list[Any]]:
    """Return the terms of the Lagrange equations (4.1) of the spherical machine, drive by drive, in 60 digits."""
    n = {name: mp.mpf(float(value)) for name, value in machine.nominal.items()}
    theta, _, _, r = (mp.mpf(float(x)) for x in q)
    th, ps, ph, rd = (mp.mpf(float(x)) for x in v)
    a_th, a_ps, a_ph, a_r = (mp.mpf(float(x)) for x in a)
    s, c, g, m_3 = mp.sin(theta), mp.cos(theta), mp.mpf(G), n["m_3"]
    far, spin = n["m_2"] * n["s_2"] ** 2 + m_3 * r**2, n["Theta_3_33"]
    along, fixed = n["Theta_2_11"] + n["Theta_3_11"] + far, n["Theta_1_33"] + n["Theta_2_33"]
    d = n["Theta_3_11"] + n["Theta_2_22"] - n["Theta_2_33"] + far
    return [
        [along * a_th, 2 * m_3 * r * rd * th, -d * s * c * ps**2, spin * s * c * ps**2, spin * s * ps * ph,
         -n["m_2"] * n["s_2"] * g * s, -m_3 * r * g * s],
        [fixed * a_ps, d * s**2 * a_ps, spin * c**2 * a_ps, spin * c * a_ph, 2 * m_3 * r * s**2 * rd * ps,
         2 * d * s * c * th * ps, -2 * spin * s * c * th * ps, -spin * s * th * ph],
        [spin * c * a_ps, spin * a_ph, -spin * s * th * ps],
        [m_3 * a_r, -m_3 * r * th**2, -m_3 * r * s**2 * ps**2, m_3 * g * c],
    ]  # fmt: skip


def torus_terms(mp: Any, machine: Manipulator, q: Array, v: Array, a: Array) -> list[list[Any]]:
    """Return the terms of (5.4) of the torus-like machine, B = 0, diagonal inertia, drive by drive, in 60 digits."""
    n = {name: mp.mpf(float(value)) for name, value in machine.nominal.items()}
    _, q2, q3 = (mp.mpf(float(x)) for x in q)
    v1, v2, v3 = (mp.mpf(float(x)) for x in v)
    a1, a2, a3 = (mp.mpf(float(x)) for x in a)
    s2, c2, s3, c3 = mp.sin(q2), mp.cos(q2), mp.sin(q3), mp.cos(q3)
    s23, c23, g = mp.sin(q2 + q3), mp.cos(q2 + q3), mp.mpf(G)
    outer = (n["m_2"] / 4 + n["m_3"]) * n["L_2"] ** 2
    i_2, i_3 = n["Theta_2_22"] + outer, n["Theta_3_22"] + n["m_3"] * n["L_3"] ** 2 / 4
    k = n["m_3"] * n["L_2"] * n["L_3"]
    b_1 = n["Theta_1_33"] + n["Theta_2_11"] + n["Theta_3_11"]
    b_2 = n["Theta_2_33"] - n["Theta_2_11"] + outer
    b_3 = n["Theta_3_33"] - n["Theta_3_11"] + n["m_3"] * n["L_3"] ** 2 / 4
    g_2, g_3 = (n["m_2"] / 2 + n["m_3"]) * n["L_2"] * g, n["m_3"] * n["L_3"] / 2 * g
    x_2, x_3 = [-s2 * b_2 * c2, -s2 * k * c23 / 2], [-s23 * b_3 * c23, -s23 * k * c2 / 2]
    return [
        [b_1 * a1, b_2 * c2**2 * a1, b_3 * c23**2 * a1, k * c2 * c23 * a1,
         *(2 * x * v1 * v2 for x in (*x_2, *x_3)), *(2 * x * v1 * v3 for x in x_3)],
        [i_2 * a2, i_3 * a2, k * c3 * a2, i_3 * a3, k * c3 / 2 * a3, *(-x * v1**2 for x in (*x_2, *x_3)),
         -k * s3 * v2 * v3, -k * s3 / 2 * v3**2, g_2 * c2, g_3 * c23],
        [i_3 * a2, k * c3 / 2 * a2, i_3 * a3, *(-x * v1**2 for x in x_3), k * s3 / 2 * v2**2, g_3 * c23],
    ]  # fmt: skip


TERMS = {"spherical": sphere_terms, "torus": torus_terms}


def torque_error(machine: Manipulator, q: Array, v: Array, a: Array) -> tuple[float, float]:
    """Return the largest error of a torque as a share of its terms, and the condition: terms over torque."""
    import mpmath as mp  # type: ignore[import-untyped,import-not-found]

    tau = np.array(inverse_dynamics(machine, [Gravity(G)])(q, v, a, [])).ravel()
    terms_of = TERMS["torus" if len(q) == 3 else "spherical"]
    share, condition = 0.0, 1.0
    with mp.workdps(DIGITS):
        for got, terms in zip(tau, terms_of(mp, machine, q, v, a), strict=True):
            exact, size = mp.fsum(terms), mp.fsum(abs(term) for term in terms)
            if size:
                share = max(share, float(abs(mp.mpf(float(got)) - exact) / size))
                condition = max(condition, float(size / abs(exact)) if exact else 1e300)
    return share, condition


def towards(make: Callable[[float, Array], tuple[Manipulator, Array, Array, Array]], values: Array) -> Iterator[Figure]:
    """Yield the worst error over random states at each distance; the tolerance is the rounding of every term."""
    for value in values:
        rng = np.random.default_rng(20260801)
        results = [torque_error(*make(float(value), rng.uniform(-1.0, 1.0, 12))) for _ in range(STATES)]
        worst = max(results)
        yield Figure(worst[0], OPERATIONS * EPS, float(value), worst[1])


def accelerated(value: float, z: Array) -> tuple[Manipulator, Array, Array, Array]:
    """Return a spherical machine with accelerations of a size [rad/s^2, m/s^2]."""
    return spherical(), np.array([1.0 + z[0] / 2, z[1], z[2], 0.8]), 3.0 * z[4:8], value * z[8:12]


def upright(value: float, z: Array) -> tuple[Manipulator, Array, Array, Array]:
    """Return a spherical machine at theta = value [rad], turning fast about the vertical."""
    return spherical(), np.array([value, z[1], z[2], 0.8]), np.array([1.0, 50.0, 5.0, 1.0]) * z[4:8], 10.0 * z[8:12]


def massive(value: float, z: Array) -> tuple[Manipulator, Array, Array, Array]:
    """Return a torus-like machine with masses of the links in a ratio."""
    return torus(m_3=25.0 * value), np.array([z[0], z[1], 2.0 * z[2]]), 3.0 * z[4:7], 10.0 * z[8:11]


def folded(value: float, z: Array) -> tuple[Manipulator, Array, Array, Array]:
    """Return a torus-like machine upright with the arm folded back on the axis but for an angle [rad]."""
    q = np.array([z[0], np.pi / 2 + value * z[1], np.pi - value])
    return torus(L_2=0.8), q, 3.0 * z[4:7], 10.0 * z[8:11]


def noise() -> Iterator[Figure]:
    """Yield the error of the torques of noisy samples in units of the stated uncertainty, noise 1e-9 to 1e-2 rad.

    Over 401 samples the root mean square of a standard normal deviation is 1 +- 0.2 for some ten independent ones in
    each coordinate; 2 is beyond chance.
    """
    t = np.linspace(0.0, 2.0, 401)
    machine = spherical()
    exact = Motion.septic([0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], 2.0)
    tau = exact.torques(machine, [Gravity(G)], times=t).tau
    for level in 10.0 ** -np.arange(2, 10):
        samples = exact.q(t) + level * np.random.default_rng(7).normal(size=(len(t), 4))
        table = Motion.from_samples(t, samples, noise=float(level)).torques(machine, [Gravity(G)])
        assert table.uncertainty is not None
        inner = slice(20, -20)  # the ends of a smoothing spline are less certain than normal
        off = float(np.sqrt(np.mean(((table.tau - tau) / table.uncertainty)[inner] ** 2)))
        yield Figure(off, 2.0, float(level), note=f"rms of tau {np.sqrt(np.mean((table.tau - tau)[inner] ** 2)):.1e}")


def overflow() -> Iterator[Figure]:
    """Yield 0 where a table is finite or an error names what overflows, else 1, for motions as short as 1e-200 s."""
    for exponent in (0, 3, 6, 20, 50, 80, 100, 150, 200):
        words = "finite"
        try:
            motion = Motion.quintic([0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], 10.0**-exponent)
            table = motion.torques(spherical(), [Gravity(G)])
            explained = bool(np.all(np.isfinite(table.rows)))
        except ValueError as error:
            words, explained = str(error), "double precision" in str(error) or str(error).startswith("duration: got ")
        yield Figure(0.0 if explained else 1.0, 0.0, 10.0**-exponent, note=words)


def _cases() -> Iterator[Case]:
    group, share = "inverse dynamics", "error of tau, share of its terms"
    ways = {
        "accelerations to 1e12": (accelerated, "acceleration [rad/s^2]", 10.0 ** np.arange(0, 13, 2)),
        "arm upright, theta -> 0": (upright, "theta [rad]", 10.0 ** -np.arange(0, 13, 2)),
        "arm folded on the axis": (folded, "angle [rad]", 10.0 ** -np.arange(0, 13, 2)),
        "ratios of masses": (massive, "m_3 / m_2", 10.0 ** np.arange(-6, 7, 2)),
    }
    for name, (make, distance, values) in ways.items():
        yield Case(group, name, share, distance, partial(towards, make, values))
    yield Case(group, "noise differentiated twice", "error over stated uncertainty", "noise [rad, m]", noise)
    yield Case(group, "overflow is named", "1 for silence", "duration [s]", overflow)


CASES: tuple[Case, ...] = tuple(_cases())
