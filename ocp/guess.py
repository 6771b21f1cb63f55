"""First guesses: a motion that a solve may start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.problem import Fixed, Problem, Where

Array = np.ndarray
PLACES = 11  # at which the controls of a straight line are balanced
ITERATIONS = 30  # of Gauss-Newton for the states at the ends


@dataclass(frozen=True, eq=False)
class Guess:
    """A motion on shares of the horizon, interpolated linearly.

    Args:
        share: (K,) increasing, from 0 to 1.
        x: (K, nx) states.
        u: (K, nu) controls.
        duration: [s].
        free: (nf,) values of the free parameters, empty for their nominal ones.
    """

    share: Array
    x: Array
    u: Array
    duration: float
    free: Array

    def state(self, share: Array) -> Array:
        """Return x at shares of the horizon, shape (..., nx)."""
        return _interpolate(share, self.share, self.x)

    def control(self, share: Array) -> Array:
        """Return u at shares of the horizon, shape (..., nu)."""
        return _interpolate(share, self.share, self.u)


def straight_line(problem: Problem, values: Sequence[float]) -> Guess:
    """Return the straight line from a state that meets the start conditions to one that meets the end conditions.

    The states at the ends are the ones nearest to zero (within the limits along the motion) that satisfy
    start(...) and end(...), by Gauss-Newton; states that no condition touches keep their value. The controls balance
    the system on the line as well as they can: they minimise |x' - f(x, u)| at each place, within their limits.

    Args:
        problem: the problem.
        values: of the parameters.
    """
    system, horizon = problem.system, problem.horizon
    if isinstance(horizon, Fixed):
        duration = horizon.duration
    else:
        duration = float(np.clip(horizon.guess, horizon.lower, horizon.upper))
    p = ca.DM(list(values))
    low, high = problem.limits(Where.ALONG, system.x)
    first = _meet(problem, Where.START, np.clip(np.zeros(len(low)), low, high), p)
    last = _meet(problem, Where.END, first, p)
    share = np.linspace(0.0, 1.0, PLACES)
    x = first + share[:, None] * (last - first)
    u = _balance(problem, x, (last - first) / duration, p)
    return Guess(share, x, u, duration, np.zeros(0))


def _meet(problem: Problem, where: Where, x: Array, p: ca.DM) -> Array:
    system = problem.system
    wanted = [c for c in problem.subject_to if c.where is where and not ca.depends_on(c.expression, system.u)]
    if not wanted:
        return x
    expression = ca.vertcat(*(c.expression for c in wanted))
    low, high = np.concatenate([c.lower for c in wanted]), np.concatenate([c.upper for c in wanted])
    function = ca.Function("ends", [system.x, system.p], [expression, ca.densify(ca.jacobian(expression, system.x))])
    for _ in range(ITERATIONS):
        value, slope = (np.array(part) for part in function(x, p))
        short = np.clip(value.ravel(), low, high) - value.ravel()
        if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(short))) or np.max(np.abs(short)) < 1e-12:
            break
        x = x + np.linalg.lstsq(slope, short, rcond=None)[0]
    return x


def _balance(problem: Problem, x: Array, rate: Array, p: ca.DM) -> Array:
    system = problem.system
    low, high = problem.limits(Where.ALONG, system.u)
    u0 = np.clip(np.zeros(len(low)), low, high)
    slope = ca.densify(ca.jacobian(system.rate, system.u))
    function = ca.Function("balance", [system.x, system.u, system.p], [system.rate, slope])
    controls = []
    for xk in x:
        f, b = (np.array(part) for part in function(xk, u0, p))
        missing = rate - f.ravel()
        usable = np.all(np.isfinite(b)) and np.all(np.isfinite(missing))
        step = np.linalg.lstsq(b, missing, rcond=None)[0] if usable and len(u0) else np.zeros(len(u0))
        controls.append(np.clip(u0 + step, low, high))
    return np.array(controls).reshape(len(x), len(u0))


def _interpolate(share: Array, places_: Array, values: Array) -> Array:
    columns = [np.interp(share, places_, column) for column in values.T]
    return np.stack(columns, axis=-1) if columns else np.zeros((*np.shape(share), 0))
