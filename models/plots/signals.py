"""What a picture of a solved motion shows: signals over time with the limits that hold for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.plots.surfaces import Mesh, capsule, joined
from ocp import Problem, SequenceSolution, Solution
from ocp.checks import Array
from ocp.problem.constraints import Constraint, Where

SHARES = np.linspace(0.0, 1.0, 9)  # points on each element at which curves are sampled
HEADINGS = {"q": "position", "v": "velocity", "tau": "drive", "x": "state", "u": "control"}
Motion = Solution | SequenceSolution


@dataclass(frozen=True, eq=False)
class Curves:
    """The components of one signal over time."""

    name: str  # of the signal
    heading: str
    labels: tuple[str, ...]  # name and unit of each component
    t: Array  # (K,) [s]; equal times where elements meet
    values: Array  # (K, n)
    lower: Array  # (K, n) limits that hold at each time; -inf, inf for none
    upper: Array
    nodes: Array  # times of the ends of the elements [s]
    at_nodes: Array  # (nodes, n)


def phases(solution: Motion) -> tuple[tuple[Solution, ...], Array]:
    """Return the solutions of the legs of a motion, and the times at which they begin [s]."""
    legs = solution.phases if isinstance(solution, SequenceSolution) else (solution,)
    return legs, np.concatenate([[0.0], np.cumsum([leg.duration for leg in legs])[:-1]])


def problem_of(solution: Solution) -> Problem:
    """Return the problem of a solution.

    Raises:
        ValueError: the solution was loaded without its problem.
    """
    if solution.problem is None:
        raise ValueError("picture: this solution was loaded without its model; use load(path, problem=...)")
    return solution.problem


def curves(solution: Motion) -> tuple[Curves, ...]:
    """Return position, velocity and drives of a motion, or state and control of a system without such signals."""
    system = problem_of(phases(solution)[0][0]).system
    names = ("q", "v", "tau") if all(name in system.signals for name in ("q", "v", "tau")) else ("x", "u")
    return tuple(curve(solution, name) for name in names if system[name].numel())


def curve(solution: Motion, name: str) -> Curves:
    """Return one signal of a motion over time, with its limits.

    Args:
        solution: with its problem.
        name: of a signal that the systems of all legs have.
    """
    legs, begins = phases(solution)
    system = problem_of(legs[0]).system
    parts = [_leg(leg, name) for leg in legs]
    t = np.concatenate([begin + part[0] for begin, part in zip(begins, parts, strict=True)])
    values, lower, upper = (np.vstack([part[k] for part in parts]) for k in (1, 2, 3))
    nodes = [begin + leg.nodes[:-1] for begin, leg in zip(begins, legs, strict=True)]
    return Curves(
        name, HEADINGS.get(name, name), tuple(map(str, system.label(name, values.shape[1]))), t, values, lower, upper,
        np.concatenate([*nodes, begins[-1:] + legs[-1].duration]),
        np.vstack([values[:: len(SHARES)], values[-1:]]),
    )  # fmt: skip


def _leg(leg: Solution, name: str) -> tuple[Array, Array, Array, Array]:
    """Return times (K,), values, lower and upper limits (K, n) of a signal on one leg."""
    problem = problem_of(leg)
    system = problem.system
    expression = ca.densify(ca.vec(system[name]))
    bounds = [ca.vec(side) for side in limits_of(system.u, problem.subject_to, expression)]
    t, x, _, u = leg.samples(SHARES)
    function = ca.Function("curve", [system.x, system.u, system.p], [expression, *map(ca.densify, bounds)])
    results = function.map(len(t))(x.T, u.T, np.tile(leg.parameters[:, None], len(t)))
    values, lower, upper = (np.array(result).T for result in results)
    return t, values, lower, upper


def limits_of(u: ca.SX, constraints: Sequence[Constraint], signal: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return expressions (n,) of the limits of a signal along the motion.

    A limited expression e with lower <= e <= upper that is a component s of the signal gives them at once. One that is
    affine in a control, and in no other, limits it by s + (lower - e) / (de/ds) .. s + (upper - e) / (de/ds), such as
    the torque that is left at a speed.

    Args:
        u: (nu,) controls.
        constraints: of a problem.
        signal: (n,) expression.
    """
    low, high = ca.SX(-np.inf * np.ones(signal.numel())), ca.SX(np.inf * np.ones(signal.numel()))
    for constraint in constraints:
        if constraint.where is not Where.ALONG:
            continue
        for c, part in enumerate(ca.vertsplit(constraint.expression)):
            sides = (ca.SX(constraint.lower[c]), ca.SX(constraint.upper[c]))
            slope = ca.jacobian(part, u)
            only = slope.nnz() == 1 and not ca.depends_on(slope, u)
            control = u[slope.sparsity().get_col()[0]] if only else None
            for i in range(signal.numel()):
                if control is not None and ca.is_equal(signal[i], control, 2) and not ca.is_equal(part, control, 2):
                    ends = [signal[i] + (side - part) / slope.nz[0] for side in sides]
                    sides_here = (ca.fmin(*ends), ca.fmax(*ends))
                elif ca.is_equal(part, signal[i], 4):
                    sides_here = sides
                else:
                    continue
                low[i], high[i] = ca.fmax(low[i], sides_here[0]), ca.fmin(high[i], sides_here[1])
    return low, high


def minimised(solution: Motion) -> str:
    """Return in words what was minimised."""
    cost = problem_of(phases(solution)[0][0]).minimise
    if cost.running.is_zero():
        return "shortest time" if cost.time else "feasible motion"
    return "least integral cost" if not cost.time else "least time plus integral cost"


def skeleton(machine: Manipulator, q: Array) -> Array:
    """Return the corners of the arm (K, k, 3) [m] at positions q (K, n), from the base to the tool."""
    symbols = list(machine.symbols.values())
    corners = ca.substitute(ca.densify(machine.skeleton), ca.vertcat(*symbols), ca.vertcat(
        *(machine.nominal[name] for name in machine.symbols))) if symbols else ca.densify(machine.skeleton)  # fmt: skip
    k = corners.shape[1]
    points = np.array(ca.Function("skeleton", [machine.q], [corners]).map(len(q))(q.T))
    return points.reshape(3, len(q), k).transpose(1, 2, 0)


def links(machine: Manipulator, q: Array) -> tuple[Mesh, ...]:
    """Return the capsules of all links as one surface for each of the positions q (K, n); () without capsules."""
    if not machine.shapes:
        return ()
    ends = ca.horzcat(*(ca.horzcat(shape.start, shape.end) for shape in machine.shapes))
    poses = skeleton(replace(machine, skeleton=ends), q)
    return tuple(
        joined([capsule(pose[2 * k], pose[2 * k + 1], shape.radius) for k, shape in enumerate(machine.shapes)])
        for pose in poses
    )
