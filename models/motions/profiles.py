"""Rest-to-rest profiles: quintic, septic, trapezoidal and S-curve, synchronised over the coordinates."""

from __future__ import annotations

import math

import numpy as np

from models.motions.hermite_splines import hermite
from models.motions.piecewise import Piecewise
from ocp import checks
from ocp.checks import Array


def rest_to_rest(q0: object, q1: object, duration: float, orders: int) -> Piecewise:
    """Return the polynomial from q0 to q1 whose derivatives of order 1 .. orders - 1 vanish at both ends.

    orders = 3: quintic (v = a = 0), orders = 4: septic (v = a = jerk = 0).

    Args:
        q0, q1: (n,) positions [rad or m].
        duration: [s] > 0.
        orders: number of conditions at each end.

    Raises:
        ValueError: sizes disagree, a number that is not finite, or a duration <= 0.
    """
    first, last = points("q0", q0), points("q1", q1)
    same_size(first, last)
    span = positive("duration", duration)
    values = np.zeros((2, orders, len(first)))
    values[0, 0], values[1, 0] = first, last
    return hermite(np.array([0.0, span]), values)


def trapezoidal(q0: object, q1: object, velocity: object, acceleration: object, duration: float | None) -> Piecewise:
    """Return the profile of bounded velocity and acceleration; all coordinates start and stop together.

    The path is a straight line in the coordinates: q = q0 + (q1 - q0) s(t), and s is as fast as the tightest
    coordinate allows, |s'| <= min v_i / |dq_i|, |s''| <= min a_i / |dq_i|.

    Args:
        q0, q1: (n,) positions [rad or m].
        velocity: (n,) or scalar > 0, limits [rad/s or m/s].
        acceleration: (n,) or scalar > 0, limits [rad/s^2 or m/s^2].
        duration: [s], None = as short as the limits allow.

    Raises:
        ValueError: a limit <= 0, or a duration shorter than the limits allow.
    """
    first, step, limits = _line(q0, q1, velocity=velocity, acceleration=acceleration)
    return _scaled(first, step, _switches(limits, 2), duration)


def s_curve(
    q0: object, q1: object, velocity: object, acceleration: object, jerk: object, duration: float | None
) -> Piecewise:
    """Return the profile of bounded velocity, acceleration and jerk: seven pieces of constant jerk, synchronised.

    Args:
        q0, q1: (n,) positions [rad or m].
        velocity, acceleration, jerk: (n,) or scalar > 0, limits [rad/s, rad/s^2, rad/s^3 or m/...].
        duration: [s], None = as short as the limits allow.

    Raises:
        ValueError: a limit <= 0, or a duration shorter than the limits allow.

    Source: L. Biagiotti, C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, 3.4.
    """
    first, step, limits = _line(q0, q1, velocity=velocity, acceleration=acceleration, jerk=jerk)
    return _scaled(first, step, _switches(limits, 3), duration)


def points(name: str, value: object) -> Array:
    """Return finite numbers as an array (n,), or raise a sentence that names them."""
    return checks.column(name, value, expected="finite numbers, one for each coordinate")


def positive(name: str, value: object) -> float:
    """Return a number of seconds > 0, or raise a sentence that names it."""
    return checks.number(name, value, "one number > 0", above=0.0)


def same_size(q0: Array, q1: Array) -> None:
    """Refuse start and end of different sizes."""
    if len(q0) != len(q1):
        raise ValueError(f"q0 has {len(q0)} components, q1 has {len(q1)}; give one for each coordinate in both")


def _line(q0: object, q1: object, **given: object) -> tuple[Array, Array, list[float]]:
    """Return q0, q1 - q0 and the limits of the path parameter s in [0, 1]."""
    first, last = points("q0", q0), points("q1", q1)
    same_size(first, last)
    step = last - first
    limits = []
    for name, value in given.items():
        limit = points(name, value)
        if limit.size not in (1, step.size) or np.any(limit < checks.SMALLEST):
            raise checks.refused(name, value, f"1 or {step.size} limits > 0, {checks.RANGE}")
        moving = step != 0.0
        if not np.any(moving):
            raise ValueError("q0 equals q1: nothing moves, so the limits do not fix a duration")
        limits.append(float(np.min(np.broadcast_to(limit, step.shape)[moving] / np.abs(step[moving]))))
    return first, step, limits


def _switches(limits: list[float], orders: int) -> tuple[Array, Array]:
    """Return times and values of the highest derivative of s: the fastest way from 0 to 1 at rest in both ends.

    With phases of jerk T_j, of constant acceleration T_a and of constant velocity T_v, s = 1 holds by construction.
    """
    speed, rise = limits[0], limits[1]
    if orders == 2:
        ramp = min(speed / rise, math.sqrt(1.0 / rise))
        cruise = max(1.0 / (rise * ramp) - ramp, 0.0)
        return np.array([0.0, ramp, ramp + cruise, 2.0 * ramp + cruise]), np.array([1.0, 0.0, -1.0]) / (
            ramp * (ramp + cruise)
        )
    jerk = limits[2]
    turn = min(rise / jerk, math.sqrt(speed / jerk), (0.5 / jerk) ** (1.0 / 3.0))
    # Top speed jerk turn (turn + hold), distance of both ramps top (2 turn + hold).
    top = jerk * turn
    hold = max(min(speed / top - turn, -1.5 * turn + math.sqrt(0.25 * turn**2 + 1.0 / top)), 0.0)
    cruise = max(1.0 / (top * (turn + hold)) - 2.0 * turn - hold, 0.0)
    widths = np.array([turn, hold, turn, cruise, turn, hold, turn])
    height = 1.0 / (turn * (turn + hold) * (2.0 * turn + hold + cruise))
    return np.concatenate([[0.0], np.cumsum(widths)]), height * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])


def _scaled(first: Array, step: Array, switches: tuple[Array, Array], duration: float | None) -> Piecewise:
    """Integrate the highest derivative of s and stretch time to the duration asked for."""
    times, highest = switches
    orders = 2 if len(highest) == 3 else 3
    shortest = float(times[-1])
    stretch = 1.0
    if duration is not None:
        stretch = positive("duration", duration) / shortest
        if stretch < 1.0 - 1e-12:
            raise ValueError(f"duration: got {duration} s, the limits need {shortest:.6g} s; give more, or None")
    widths = np.diff(times) * stretch
    kept = widths > 1e-12 * shortest
    widths, highest = widths[kept], highest[kept] / stretch**orders
    coefficients = np.zeros((len(widths), orders + 1))
    state = np.zeros(orders)  # s, s', (s'') at the start of the piece
    for k, (width, top) in enumerate(zip(widths, highest, strict=True)):
        full = np.append(state, top)
        coefficients[k] = full / [math.factorial(j) for j in range(orders + 1)]
        state = np.array(
            [
                sum(full[i] * width ** (i - j) / math.factorial(i - j) for i in range(j, orders + 1))
                for j in range(orders)
            ]
        )
    result = coefficients[:, :, None] * step
    result[:, 0] += first
    return Piecewise(np.concatenate([[0.0], np.cumsum(widths)]), result)
