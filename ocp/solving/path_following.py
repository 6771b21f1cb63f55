"""Motions along a given path of the states that the controls move last: the other states, and the controls."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import slopes
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.transcription.guess import Guess

SMOOTH_POINTS = 41  # points of a smooth motion
ITERATIONS, CLOSE = 30, 1e-9  # of Newton's method for the states on a path, and relative residual that ends it


def layers_of(problem: Problem) -> list[Array]:
    """Return the indices of the states, grouped by the number of integrations between the controls and them."""
    system = problem.system
    by_x, by_u = (np.zeros((system.x.numel(), symbols.numel()), dtype=bool) for symbols in (system.x, system.u))
    for matrix, symbols in ((by_x, system.x), (by_u, system.u)):
        matrix[ca.jacobian_sparsity(system.rate, symbols).get_triplet()] = True
    left = np.ones(system.x.numel(), dtype=bool)
    reached = by_u.any(axis=1) if by_u.size else np.zeros(len(left), dtype=bool)
    layers = []
    while reached.any():
        layers.append(np.flatnonzero(reached))
        left &= ~reached
        reached = left & by_x[:, layers[-1]].any(axis=1)
    return layers


def _drifted(path: Array, ends: tuple[Array, Array], duration: float) -> Array:
    """Return a path modified so that it starts and ends with given rates (nx,)."""
    s = np.linspace(0.0, 1.0, len(path))[:, None]
    leaving, arriving = s - 6.0 * s**3 + 8.0 * s**4 - 3.0 * s**5, -4.0 * s**3 + 7.0 * s**4 - 3.0 * s**5
    return np.asarray(path + duration * (leaving * ends[0] + arriving * ends[1]))


def quintic(first: Array, last: Array, layers: int) -> Array:
    """Return a path (K, nx) between two states: a quintic, or a septic for more than two integrations."""
    share = np.linspace(0.0, 1.0, SMOOTH_POINTS)
    if layers > 2:
        step = share**4 * (35.0 - 84.0 * share + 70.0 * share**2 - 20.0 * share**3)
    else:
        step = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return np.asarray(first + step[:, None] * (last - first))


def follow(problem: Problem, path: Array, duration: float, layers: list[Array], p: Array) -> Guess:
    """Return the motion along the last layer of a path, with the other states and the controls that it needs."""
    system, share, x = problem.system, np.linspace(0.0, 1.0, SMOOTH_POINTS), path.copy()
    if system.t is not None:
        x[:, system.clock] = path[0, system.clock] + share * duration
    function, still = slopes(system), np.clip(np.zeros(system.u.numel()), *problem.limits(Where.ALONG, system.u))
    begun = evaluate(function, x, still, p)
    at_x: tuple[Array, ...] | None = begun  # rates and their slopes at the states x
    speeds = np.nan_to_num(begun[0][[0, -1]])
    if layers and np.any(speeds[:, layers[-1]]):
        x[:, layers[-1]] = _drifted(x[:, layers[-1]], (speeds[0, layers[-1]], speeds[1, layers[-1]]), duration)
        at_x = None
    for known, wanted in zip(reversed(layers[1:]), reversed(layers[:-1]), strict=True):
        rates = np.gradient(x[:, known], share * duration, axis=0, edge_order=2)
        for _ in range(ITERATIONS):
            at_x = evaluate(function, x, still, p) if at_x is None else at_x
            f, slope, _ = at_x
            short = rates - f[:, known]
            size = np.max(np.abs(rates), axis=0) + np.max(np.abs(f[:, known]), axis=0)
            # Differences of constant states are rounding errors.
            if not np.any(np.abs(short) > CLOSE * (size + 1e-3 * np.max(np.abs(x[:, known]), axis=0) / duration)):
                break
            blocks = slope.reshape(len(share), x.shape[1], x.shape[1]).transpose(0, 2, 1)
            blocks = blocks[:, known[:, None], wanted]
            if not (np.all(np.isfinite(short)) and np.all(np.isfinite(blocks))):
                break
            x[:, wanted] += _least_squares(blocks, short)
            at_x = None
    rates = np.gradient(x, share * duration, axis=0, edge_order=2)
    f, _, by_u = evaluate(function, x, still, p) if at_x is None else at_x
    return Guess(share, x, balance(problem, rates, f, by_u), duration, np.zeros(0))


def balance(problem: Problem, rates: Array, f: Array, by_u: Array) -> Array:
    """Return the controls (K, nu) with which rates (K, nx) are met best.

    Args:
        problem: one phase.
        rates: that the states shall have.
        f: (K, nx) rates with the controls nearest to zero.
        by_u: (K, nu nx) their derivatives by the controls.
    """
    low, high = problem.limits(Where.ALONG, problem.system.u)
    u0, count = np.clip(np.zeros(len(low)), low, high), len(rates)
    missing, blocks = rates - f, by_u.reshape(count, len(u0), rates.shape[1]).transpose(0, 2, 1)
    usable = np.isfinite(missing).all(axis=1) & np.isfinite(blocks).all(axis=(1, 2))
    u = np.tile(u0, (count, 1))
    if len(u0) and usable.any():
        u[usable] += _least_squares(blocks[usable], missing[usable])
    return u


def _least_squares(matrices: Array, right: Array) -> Array:
    """Return the least-squares solutions (K, n) of stacks of systems (K, m, n), (K, m)."""
    if np.all(matrices == matrices[:1]):
        matrices = matrices[:1]  # one inverse serves all
    size = np.linalg.norm(matrices, axis=1)  # of the columns, which may differ in units
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.einsum("kij,kj->ki", np.linalg.pinv(matrices / size[:, None, :]), right) / size)
