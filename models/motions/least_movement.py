"""Joints of an arm moved as little as possible for a velocity of its tool: J v = X, v = J' (J J')^-1 X."""

from __future__ import annotations

import casadi as ca
import numpy as np

from models.machines.body_metrics import angular_velocity
from models.machines.manipulator import Manipulator
from models.rigid_bodies.orientations import axis_angle
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

FLAT = 1e-5  # smallest singular value of the Jacobian [m and 1] that counts as regular
EXACT = 1e-12  # movement of the joints in the last Newton step


def settled(place: ca.Function, q: Array, points: Array, axes: Array | None) -> Array:
    """Return q (K, n) moved as little as possible until the tool is at points (K, 3) with axes (K, 3, 3)."""
    for _ in range(8):
        position, turned, jacobian = evaluate(place, q)
        error = points - position
        if axes is not None:
            error = np.hstack([error, axis_angle(axes @ turned.reshape(-1, 3, 3))])  # rows are the columns of R
        matrices = matrices_of(jacobian, q.shape[1])
        step = pulled(matrices, Least(matrices)(error))
        q = q + step
        if np.max(np.abs(step)) < EXACT:
            break
    return q


class SingularError(ValueError):
    """A Jacobian without full rank."""


class Least:
    """Solutions of J J' l = b."""

    def __init__(self, jacobian: Array) -> None:
        if not np.all(np.isfinite(jacobian)) or np.min(np.linalg.svd(jacobian, compute_uv=False)) < FLAT:
            raise SingularError("the arm is singular along the path, or out of reach")
        self.square = jacobian @ jacobian.swapaxes(1, 2)

    def __call__(self, right: Array) -> Array:
        """Return l (K, m)."""
        return np.asarray(np.linalg.solve(self.square, right[..., None])[..., 0])


def pulled(jacobian: Array, force: Array) -> Array:
    """Return J' l (K, n)."""
    return np.asarray(np.einsum("kij,ki->kj", jacobian, force))


def pushed(jacobian: Array, v: Array) -> Array:
    """Return J v (K, m)."""
    return np.asarray(np.einsum("kij,kj->ki", jacobian, v))


def matrices_of(values: Array, n: int) -> Array:
    """Return matrices (K, m, n) of rows of column-major values."""
    return values.reshape(len(values), n, -1).swapaxes(1, 2)


def tool_functions(machine: Manipulator, turned: bool) -> tuple[ca.Function, ca.Function]:
    """Return q -> tool, its axes, J; and (q, v, a) -> J and its two rates; J with the angular velocity if `turned`."""
    q, v, a = machine.q, machine.v, ca.SX.sym("a", machine.q.numel())
    axes = machine.tool_orientation
    jacobian = ca.jacobian(machine.tool, q)
    if turned:
        jacobian = ca.vertcat(jacobian, axes @ angular_velocity(axes, q))
    flat = ca.vec(ca.densify(jacobian))
    first = ca.jtimes(flat, q, v)
    second = ca.jtimes(first, ca.vertcat(q, v), ca.vertcat(v, a))
    place = ca.Function("place", [q], ca.cse([ca.densify(machine.tool), ca.vec(ca.densify(axes)), flat]))
    return place, ca.Function("terms", [q, v, a], ca.cse([flat, first, second]))
