"""The straight line between two positions, timed within limits: a first result at once, and an initial guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from models.motions.motion import Motion
from models.motions.path_timing import path_system
from models.motions.paths import path_through
from models.torques.torque_functions import inverse_dynamics
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import along, end, start
from ocp.problem.problem import Bolza, Free, Problem
from ocp.system import System

POINTS = 101  # of a motion that becomes a guess


def straight_path(
    machine: Manipulator, effects: Sequence[Effect], begin: object, finish: object, limits: Mapping[str, Any]
) -> tuple[Motion, Problem]:
    """Return the straight line between two positions of the joints, and the problem of its fastest timing.

    The problem has one degree of freedom and takes 0.02 to 0.1 s to solve; `timed(path, solution)` is the motion.
    It takes longer than the fastest motion between the positions, which leaves the line to use inertia and weight.

    Args:
        machine, effects: of numbers.
        begin, finish: (n,) positions [rad or m].
        limits: of signals such as q, v, a, tau: (lower, upper) or values in both directions, such as `machine.limits`.

    Raises:
        ValueError: positions that are the same, or of another size; an unknown signal.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    checks.mapping("limits", limits, "a dict by signal, such as machine.limits")
    n, wanted = len(machine.coordinates), "a position, one number for each coordinate"
    first, last = (checks.column(name, value, n, wanted) for name, value in (("begin", begin), ("finish", finish)))
    if np.array_equal(first, last):
        raise ValueError(f"finish: {checks.shown(finish)} is the same position as begin; there is no way to go")
    path = path_through([first, last])
    system = path_system(machine, effects, path)
    ends = (start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0))
    held = [along(system["ds"], 0.0, None)]
    for name, sides in limits.items():
        size = system[name].numel()
        pair = isinstance(sides, tuple) and len(sides) == 2 and not np.isscalar(sides[0])
        low, high = (checks.column(f"limits: {name}", side, None if np.isscalar(side) else size, "limits", finite=False)
                     for side in (sides if pair else (sides, sides)))  # fmt: skip
        low, high = np.broadcast_to(low if pair else -low, size), np.broadcast_to(high, size)
        held.append(along(system[name], low, high))
    return path, Problem(system, Free(guess=1.0), Bolza(time=1.0), (*ends, *held))


def states_along(
    motion: Motion, system: System, machine: Manipulator, effects: Sequence[Effect] = (), points: int = POINTS
) -> tuple[Array, Array, Array]:
    """Return a motion as states and controls of a form, such as for `Guess(share, x, u, motion.duration)`.

    The second half of the state follows from v = v(q, .), which is linear in it; the torques by inverse dynamics.

    Args:
        motion: of the joints.
        system: a form of the machine with these effects, whose control is the torque.
        machine, effects: the same.
        points: number of points, equally spaced in time.

    Returns:
        Shares of the duration (K,), states (K, nx), controls (K, nu).

    Raises:
        ValueError: the system has other states or controls, which the motion alone does not determine.
    """
    checks.instance("motion", motion, Motion, "a Motion")
    checks.instance("system", system, System, "a form of the machine")
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    n = len(machine.coordinates)
    if system.x.numel() != 2 * n or system.u.numel() != n or not ca.is_equal(system["tau"], system.u, 1):
        raise ValueError(
            "states_along: the system has states or controls of effects, which a motion does not determine"
        )
    share = np.linspace(0.0, 1.0, checks.whole("points", points, 2))
    t = motion.start + share * motion.duration
    q, v, a = motion.q(t), motion.v(t), motion.a(t)
    p = np.tile(np.array(system.values()), (len(t), 1))
    second = system.x[n:]
    slope = ca.Function("slope", [system.x[:n], system.p], [ca.densify(ca.jacobian(system["v"], second))])
    (slopes,) = evaluate(slope, q, p)
    third = np.linalg.solve(slopes.reshape(len(t), n, n).transpose(0, 2, 1), v[:, :, None])[:, :, 0]
    (tau,) = evaluate(inverse_dynamics(machine, effects), q, v, a, p)
    return share, np.hstack([q, third]), tau.reshape(len(t), n)
