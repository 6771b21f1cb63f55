"""Metric and angular velocity of a body from its placement; zero entries and idle coordinates leave the graph."""

from __future__ import annotations

import casadi as ca
import numpy as np

from models.machines.frames import NEGLIGIBLE, SAMPLES


def point_metric(point: ca.SX, orientation: ca.SX, q: ca.SX) -> ca.SX:
    """Return the metric (n, n) of a unit point mass, J' J with J = R' d(point)/dq.

    Args:
        point: (3,) position [m].
        orientation: (3, 3) R of a body that carries the point. The metric is the same for every rotation; the axes of
            the body make most entries of J constant, which gives the shortest graph.
        q: (n,) coordinates.
    """
    slope = simplified(orientation.T @ ca.jacobian(point, q), q)
    return simplified(slope.T @ slope, q)


def turning_metric(orientation: ca.SX, inertia: ca.SX, q: ca.SX) -> ca.SX:
    """Return the metric (n, n) of the rotation of a body, J' Theta J with omega = J v in its axes.

    Args:
        orientation: (3, 3) rotation matrix, columns = body axes.
        inertia: (3, 3) tensor in body axes [kg m^2].
        q: (n,) coordinates.
    """
    slope = angular_velocity(orientation, q)
    return simplified(slope.T @ inertia @ slope, q)


def angular_velocity(orientation: ca.SX, q: ca.SX) -> ca.SX:
    """Return J (3, n) with the angular velocity omega = J v in body axes, skew(omega) = R' dR/dt.

    Args:
        orientation: (3, 3) rotation matrix R, columns = body axes.
        q: (n,) coordinates.
    """
    columns = []
    for qi in ca.vertsplit(q):
        skew = orientation.T @ ca.reshape(ca.jacobian(ca.vec(ca.densify(orientation)), qi), 3, 3)
        columns.append(ca.vertcat(skew[2, 1], skew[0, 2], skew[1, 0]))
    return simplified(ca.horzcat(*columns), q)


def simplified(matrix: ca.SX, q: ca.SX) -> ca.SX:
    """Return the same matrix with a shorter graph: vanishing entries are dropped, idle coordinates set to zero.

    Symbolic simplification does not find that sin(q)^2 + cos(q)^2 - 1 vanishes or does not depend on q. Both are
    detected numerically here, at sampled values of every free symbol.

    Args:
        matrix: (m, n) expressions in q and other symbols.
        q: (n,) coordinates.
    """
    dense = ca.densify(matrix)
    symbols = ca.symvar(ca.vertcat(ca.vec(dense), q))
    entries = ca.vec(dense)
    values = np.random.default_rng(20260102).uniform(0.3, 1.7, (len(symbols), SAMPLES))
    outputs = [entries, ca.jacobian(entries, q)]
    function = ca.Function("entries", [ca.vertcat(*symbols)], [ca.densify(output) for output in outputs])
    largest, slope = (np.array(part) for part in function.map(SAMPLES)(values))
    largest = np.max(np.abs(largest), axis=1)
    slope = np.max(np.abs(slope).reshape(entries.numel(), SAMPLES, q.numel()), axis=1)
    floor = 100.0 * NEGLIGIBLE * max(float(np.max(largest)), 1e-300)
    result = ca.SX(*matrix.shape)
    for k in range(entries.numel()):
        if largest[k] <= floor:
            continue
        idle = [i for i in range(q.numel()) if slope[k, i] <= 100.0 * NEGLIGIBLE * largest[k]]
        entry = entries[k]
        if idle:
            entry = ca.substitute(entry, q[idle], ca.SX.zeros(len(idle)))
        result[k % matrix.shape[0], k // matrix.shape[0]] = entry
    return ca.sparsify(result)


def about_axis(moment: ca.SX | float) -> ca.SX:
    """Return the inertia (3, 3) of a body that only turns about its third axis: diag(0, 0, moment)."""
    return ca.sparsify(ca.diag(ca.vertcat(0, 0, ca.SX(moment))))
