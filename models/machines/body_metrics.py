"""Metric and angular velocity of bodies from their placement, with what does not matter left out of the graph."""

from __future__ import annotations

import casadi as ca
import numpy as np

from models.machines.frames import NEGLIGIBLE, SAMPLES


def point_metric(point: ca.SX, orientation: ca.SX, q: ca.SX) -> ca.SX:
    """Return the metric (n, n) of a unit point mass, J' J with J = R' d(point)/dq.

    Args:
        point: (3,) place [m].
        orientation: (3, 3) R of a body that moves along; any rotation, the best one leaves most of J constant.
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
    """Return a matrix with every coordinate that an entry does not depend on set to zero there, and zeros dropped.

    A graph cannot be simplified far enough to see that; it is found by numbers, with every free symbol sampled.

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
    size, slope = (np.array(part) for part in function.map(SAMPLES)(values))
    size = np.max(np.abs(size), axis=1)
    slope = np.max(np.abs(slope).reshape(entries.numel(), SAMPLES, q.numel()), axis=1)
    floor = 100.0 * NEGLIGIBLE * max(float(np.max(size)), 1e-300)
    result = ca.SX(*matrix.shape)
    for k in range(entries.numel()):
        if size[k] <= floor:
            continue
        idle = [i for i in range(q.numel()) if slope[k, i] <= 100.0 * NEGLIGIBLE * size[k]]
        entry = entries[k]
        if idle:
            entry = ca.substitute(entry, q[idle], ca.SX.zeros(len(idle)))
        result[k % matrix.shape[0], k // matrix.shape[0]] = entry
    return ca.sparsify(result)


def about_axis(moment: ca.SX | float) -> ca.SX:
    """Return the inertia (3, 3) of a body that only turns about its third axis; the rest plays no part."""
    return ca.sparsify(ca.diag(ca.vertcat(0, 0, ca.SX(moment))))
