"""Graphs evaluated in extended precision, and the accelerations of the bodies of a machine, for the stability suite."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from ocp.checks import Array

Extended = np.longdouble  # 64 bits of mantissa on x86; where it is a double only, references are as good as the forms
OPERATIONS: Mapping[int, Callable[..., Array]] = {
    ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide, ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square, ca.OP_TWICE: lambda a: a + a, ca.OP_INV: lambda a: 1 / a, ca.OP_SQRT: np.sqrt,
    ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_TANH: np.tanh, ca.OP_FABS: np.abs, ca.OP_ASSIGN: lambda a: a,
}  # fmt: skip


def extended(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX], columns: Sequence[Array]) -> list[Array]:
    """Return expressions at many points in extended precision, instruction by instruction.

    Args:
        inputs: columns of symbols.
        outputs: expressions in them.
        columns: values (m, K) of each input, one column for one point.

    Returns:
        of every output its entries (rows, columns, K).

    Raises:
        KeyError: an operation that is not listed here.
    """
    dense = [ca.densify(ca.SX(output)) for output in outputs]
    function = ca.Function("graph", list(inputs), [ca.vec(output) for output in dense], {"cse": True})
    count = columns[0].shape[1]
    values = [np.asarray(column).astype(Extended) for column in columns]
    work: list[Array] = [np.zeros(0)] * function.sz_w()
    results = [np.zeros((output.numel(), count), dtype=Extended) for output in dense]
    for k in range(function.n_instructions()):
        code, into, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_CONST:
            work[into[0]] = np.full(count, function.instruction_constant(k), dtype=Extended)
        elif code == ca.OP_INPUT:
            work[into[0]] = values[of[0]][of[1]]
        elif code == ca.OP_OUTPUT:
            results[into[0]][into[1]] = work[of[0]]
        else:
            work[into[0]] = OPERATIONS[code](*(work[i] for i in of))
    return [part.reshape((*output.shape, count), order="F") for part, output in zip(results, dense, strict=True)]


def solve(matrices: Array, right: Array) -> Array:
    """Return the solutions (n, K) of symmetric positive definite systems (n, n, K), (n, K) by elimination."""
    a, b = matrices.copy(), right.copy()
    n = len(b)
    for k in range(n):
        for i in range(k + 1, n):
            factor = a[i, k] / a[k, k]
            a[i] -= factor * a[k]
            b[i] -= factor * b[k]
    for k in reversed(range(n)):
        b[k] = (b[k] - np.sum(a[k, k + 1 :] * b[k + 1 :], axis=0)) / a[k, k]
    return np.asarray(b)


def accelerations(
    machine: Manipulator, gravity: ca.SX, points: tuple[Array, Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """Return what the bodies of a machine do, in extended precision: neither its metric nor its frames are used.

    T = sum 1/2 m |dc/dt|^2 + 1/2 omega' Theta omega,  M a = tau - d/dq'(dT/dv) v + dT/dq - dU/dq

    Args:
        machine: with bodies.
        gravity: symbol of g along -e_3 [m/s^2]; the last of the parameters.
        points: q, v, tau (n, K), and the parameters (m, K), those of the machine first.

    Returns:
        accelerations (n, K); M (n, n, K); the sizes of the forces that add up to M a (n, K), with what they change by
        when q changes by its own size: a last digit of q is no more than that times eps.
    """
    kinetic, potential = ca.SX(0), ca.SX(0)
    for body in machine.bodies:
        velocity = ca.jacobian(body.centre, machine.q) @ machine.v
        turning = ca.reshape(ca.jacobian(ca.vec(ca.densify(body.orientation)), machine.q) @ machine.v, 3, 3)
        spin = body.orientation.T @ turning
        omega = ca.inv_skew((spin - spin.T) / 2)
        kinetic += body.mass * ca.dot(velocity, velocity) / 2 + ca.dot(omega, body.inertia @ omega) / 2
        potential += body.mass * gravity * body.centre[2]
    momentum = ca.gradient(kinetic, machine.v)
    weight = ca.gradient(potential, machine.q)
    inertial = [ca.jtimes(momentum, machine.q, machine.v), ca.gradient(kinetic, machine.q)]
    inputs = [machine.q, machine.v, ca.vertcat(*machine.symbols.values(), gravity)]
    q, v, tau, numbers = points
    tilted = ca.fabs(ca.jacobian(weight, machine.q)) @ ca.fabs(machine.q)
    matrix, moved, pushed, heavy, change = extended(
        inputs, [ca.jacobian(momentum, machine.v), *inertial, weight, tilted], [q, v, numbers]
    )
    forces = [tau.astype(Extended), -moved[:, 0], pushed[:, 0], -heavy[:, 0]]
    right: Array = sum(forces[1:], forces[0])
    return solve(matrix, right), matrix, np.asarray(sum(np.abs(part) for part in (*forces, change[:, 0])))
