"""States that satisfy nonlinear conditions and are near to another one, within limits."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

STARTS, SEED = 48, 0  # random states from which a search begins, everywhere and as many nearby
NEARBY = 0.2  # distance of these as a share of the range
STEPS, LAST = 60, 15  # of a search, and those at its end that do not pull towards the near state
LONGEST = 0.15  # step of a state as a share of its range
PULL = 0.2  # share of the distance from the near state that one step takes back, where the conditions leave it free
EXACT = 1e-9  # error of a condition relative to its Jacobian


def nearby(
    function: ca.Function, near: Array, p: Array, limits: tuple[Array, Array], along: tuple[Array, Array]
) -> Array:
    """Return the states (K, nx) that are found to satisfy conditions, the nearest to another state first.

    Damped Gauss-Newton steps (Levenberg and Marquardt) of limited length from many states at once, which move towards
    the near state where the conditions leave them free. Undamped steps from the near state alone jump far away.

    Args:
        function: state, parameters -> values (m,) of the conditions, their Jacobian (m, nx).
        near: (nx,) state.
        p: (np,) parameters.
        limits: lower and upper (m,) of the conditions.
        along: lower and upper (nx,) of the states along the motion; states without limits are looked for nearby.
    """
    low, high = along[0], np.maximum(*along)
    room = np.where(np.isfinite(near), np.maximum(np.abs(near), 1.0), 1.0)
    span = np.where(np.isfinite(high - low), high - low, 4.0 * room)
    begin, end = (
        np.where(np.isfinite(low), low, near - span / 2.0),
        np.where(np.isfinite(high), high, near + span / 2.0),
    )
    span = np.where(span > 0.0, span, 1.0)
    random = np.random.default_rng(SEED)
    around = near + random.uniform(-NEARBY, NEARBY, (STARTS, len(near))) * span
    x = np.vstack([near, random.uniform(begin, end, (STARTS, len(near))), np.clip(around, low, high)])
    slope = evaluate(function, x, p)[1]
    moved = np.any(slope.reshape(len(x), len(near), -1) != 0.0, axis=(0, 2))
    x[:, ~moved] = near[~moved]
    for step in range(STEPS):
        errors, rows = _scaled(function, x, p, limits, span)
        fine = np.all(np.isfinite(errors), axis=1) & np.all(np.isfinite(rows), axis=(1, 2))
        x, errors, rows = x[fine], errors[fine], rows[fine]
        if not len(x):
            return np.empty((0, len(near)))
        transposed = rows.swapaxes(1, 2)
        damping = 0.5 * np.sum(errors**2, axis=1) + 1e-14
        normal = rows @ transposed + damping[:, None, None] * np.eye(rows.shape[1])
        pull = (PULL if step < STEPS - LAST else 0.0) * (near - x) / span
        wanted = errors[..., None] - rows @ pull[..., None]
        change = pull + (transposed @ np.linalg.solve(normal, wanted))[..., 0]
        largest = np.max(np.abs(change), axis=1, keepdims=True)
        x = np.clip(x + span * change * np.minimum(1.0, LONGEST / np.maximum(largest, 1e-300)), low, high)
    errors, _ = _scaled(function, x, p, limits, span)
    found = x[np.max(np.abs(errors), axis=1) < EXACT]
    return np.asarray(found[np.argsort(np.sum(((found - near) / span) ** 2, axis=1), kind="stable")])


def _scaled(function: ca.Function, x: Array, p: Array, limits: tuple[Array, Array], span: Array) -> tuple[Array, Array]:
    """Return errors (K, m) and Jacobians (K, m, nx) of states as shares of their ranges, rows of length one."""
    value, slope = (np.where(np.isfinite(part), part, np.nan) for part in evaluate(function, x, p))
    rows = slope.reshape(len(x), len(span), -1).swapaxes(1, 2) * span
    size = np.linalg.norm(rows, axis=2)
    size = np.where(size > 0.0, size, 1.0)
    return (np.clip(value, *limits) - value) / size, rows / size[..., None]
