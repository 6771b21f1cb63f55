"""Motions of the tool of any arm of links along a path in space, with its orientation if wanted, by least movement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from models.machines.inverse_kinematics import whole_turns
from models.machines.manipulator import Manipulator
from models.motions.coordinate_labels import labels_of
from models.motions.latest_derivatives import remembered
from models.motions.least_movement import Least, SingularError, matrices_of, pulled, pushed, settled, tool_functions
from models.motions.motion import Motion
from models.motions.timing_laws import Composed
from models.motions.tool_branches import Choice
from models.motions.tool_paths import ToolPath
from models.rigid_bodies.orientations import axis_angle, rotation_matrix
from models.rigid_bodies.tool_poses import inverse_kinematics
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

NO_KNOTS = np.empty(0)
STEPS = 200  # of the path, at least
SHORTEST = 1e-6  # step as a share of the length at which the arm does not go on
LONG = 0.05  # largest movement of a joint in a step [rad or m]
STARTS = 6  # solutions at the start that are tried


@dataclass(frozen=True, eq=False)
class Turn:
    """Orientation of the tool along a path, R(s) = R_0 exp(s rate x): about one axis that does not move.

    Args:
        first: (3, 3) axes of the tool at s = 0.
        rate: (3,) angle over the length times the axis, in the base [rad/m].
    """

    first: Array
    rate: Array

    @classmethod
    def between(cls, first: Array, last: Array, length: float) -> Turn:
        """Return the shortest turn from one orientation to another over a length of the path."""
        return cls(first, axis_angle((last @ first.T)[None])[0] / length)

    def at(self, s: Array) -> Array:
        """Return R (K, 3, 3) at lengths (K,)."""
        size = float(np.linalg.norm(self.rate))
        if size == 0.0:
            return np.broadcast_to(self.first, (len(s), 3, 3))
        x, y, z = self.rate / size
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = (size * s)[:, None, None]
        turned = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
        return np.asarray(turned @ self.first)


@dataclass(frozen=True, eq=False)
class ArmCurve:
    """q(t) of an arm whose tool is at x(t), R(t): J v = (x', omega) with the least v, and its derivatives.

    v = J' l with J J' l = X_1; the derivatives of both equations give accelerations and jerks.
    """

    tool: Composed  # x over time
    turn: Turn | None
    nodes: Array  # (G,) lengths of the path [m]
    q: Array  # (G, n) there
    slopes: Array  # (G, n) dq/ds
    place: ca.Function  # q -> tool, axes of it, J
    terms: ca.Function  # (q, v, a) -> J, dJ/dt, d^2 J/dt^2 at constant jerk
    last: dict[str, Array] = field(default_factory=dict)

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        return remembered(self.last, t, order, self._derivatives)

    def _derivatives(self, t: Array, highest: int) -> list[Array]:
        s = self.tool.law.derivative(t, 0)[:, 0]
        q = settled(self.place, hermite(self.nodes, self.q, self.slopes, s), self.tool(t, 0), self._axes(s))
        n, zero = q.shape[1], np.zeros_like(q)
        rates = [self._rates(t, k) for k in range(1, highest + 1)]
        jacobian = matrices_of(evaluate(self.terms, q, zero, zero)[0], n)
        solve = Least(jacobian)
        force = solve(rates[0])
        v = pulled(jacobian, force)
        _, first, _ = (matrices_of(part, n) for part in evaluate(self.terms, q, v, zero))
        # J a = X_2 - J' v and a = J'' l + J^T l'.
        bent = pulled(first, force)
        change = solve(rates[1] - pushed(first, v) - pushed(jacobian, bent))
        a = bent + pulled(jacobian, change)
        if highest < 3:
            return [q, v, a]
        _, _, second = (matrices_of(part, n) for part in evaluate(self.terms, q, v, a))
        bent = pulled(second, force) + 2.0 * pulled(first, change)
        left = rates[2] - 2.0 * pushed(first, a) - pushed(second, v)
        return [q, v, a, bent + pulled(jacobian, solve(left - pushed(jacobian, bent)))]

    def _axes(self, s: Array) -> Array | None:
        return None if self.turn is None else self.turn.at(s)

    def _rates(self, t: Array, order: int) -> Array:
        """Return the derivative of position and, if it is given, orientation over time (K, 3 or 6)."""
        moved = self.tool(t, order)
        if self.turn is None:
            return moved
        return np.hstack([moved, self.tool.law.derivative(t, order) * self.turn.rate])


def arm_curve(
    machine: Manipulator, tool: Composed, length: float, turn: Turn | None, near: Array | None,
    limits: tuple[Array, Array],
) -> tuple[ArmCurve, int, int]:  # fmt: skip
    """Return the curve of an arm along a path, the number of the solution at the start that it begins with, and of all.

    Args:
        machine: of numbers.
        tool: path and timing law.
        length: of the path.
        turn: orientation of the tool; None for any.
        near: (n,) where the motion should begin; None: the middle of the limits.
        limits: lower and upper (n,).

    Raises:
        ValueError: the start cannot be reached, or no solution follows the path within the limits.
    """
    start, axes = tool.path(np.zeros(1), 0)[0], None if turn is None else turn.first
    angular = np.array([coordinate.unit == "rad" for coordinate in machine.coordinates])
    found = inverse_kinematics(machine, start, axes, near=near)
    begins = [q + turns for q in found if (turns := whole_turns(q, q, angular, limits)) is not None]
    if not begins:
        raise ValueError(f"{_at(start)} at the start cannot be reached within the limits")
    place, terms = tool_functions(machine, turn is not None)
    best, reason = -1.0, ""
    for number, begin in enumerate(begins[:STARTS], 1):
        nodes, q, why = _followed(place, tool, turn, begin, length, angular, limits)
        if not why:
            slopes = np.array([_slope(place, tool, turn, s, one) for s, one in zip(nodes, q, strict=True)])
            return ArmCurve(tool, turn, nodes, q, slopes, place, terms), number, len(begins)
        if nodes[-1] > best:
            best, reason = float(nodes[-1]), why
    where = _at(tool.path(np.array([max(best, 0.0)]), 0)[0])
    raise ValueError(f"{where}, {best:.4g} m along the path: {reason}; near= chooses another beginning")


def orientation_along(rotation: object, length: float) -> Turn | None:
    """Return the orientation along a path: of one rotation, held, or of a pair of them.

    Args:
        rotation: None, roll, pitch, yaw [rad] or a matrix (3, 3); or a tuple of two of these, from and to.
        length: of the path [m].

    Raises:
        ValueError: no rotation.
    """
    if rotation is None:
        return None
    if isinstance(rotation, tuple) and len(rotation) == 2:
        return Turn.between(rotation_matrix(rotation[0]), rotation_matrix(rotation[1]), length)
    return Turn(rotation_matrix(rotation), np.zeros(3))


def hermite(nodes: Array, values: Array, slopes: Array, s: Array) -> Array:
    """Return the cubic through values (G, n) with slopes at nodes (G,), at s (K,)."""
    k = np.clip(np.searchsorted(nodes, s, side="right") - 1, 0, len(nodes) - 2)
    step = np.diff(nodes)[k]
    x = ((s - nodes[k]) / step)[:, None]
    h = step[:, None]
    return np.asarray(
        (1 + 2 * x) * (1 - x) ** 2 * values[k] + x * (1 - x) ** 2 * h * slopes[k]
        + x**2 * (3 - 2 * x) * values[k + 1] - x**2 * (1 - x) * h * slopes[k + 1]
    )  # fmt: skip


def _followed(
    place: ca.Function, tool: Composed, turn: Turn | None, begin: Array, length: float, angular: Array,
    limits: tuple[Array, Array],
) -> tuple[Array, Array, str]:  # fmt: skip
    """Return lengths and positions (G, n) as far as the arm follows the path, and why no farther.

    The positions are as many full turns from `begin` as the limits need.

    Steps of Runge and Kutta of order 4 along dq/ds = J^+ dx/ds, each settled on the path, halved where joints move far.
    """
    nodes, path, longest = [0.0], [begin], length / STEPS
    h, turns, least, most = longest, np.zeros(len(begin)), begin, begin
    while nodes[-1] < length:
        s, q = nodes[-1], path[-1]
        after = length if s + 1.01 * h >= length else s + h
        try:
            moved = _step(place, tool, turn, s, after, q)
        except SingularError:
            moved = None
        if moved is None or np.max(np.abs(moved - q)) > LONG:
            h /= 2.0
            if h < SHORTEST * length:
                return np.array(nodes), np.array(path) + turns, "the arm is singular there, or out of reach"
            continue
        least, most = np.minimum(least, moved), np.maximum(most, moved)
        needed = whole_turns(least, most, angular, limits)
        if needed is None:
            return np.array(nodes), np.array(path) + turns, "a joint would leave its limits there"
        nodes.append(after)
        path.append(moved)
        turns, h = needed, min(2.0 * h, longest)
    return np.array(nodes), np.array(path) + turns, ""


def _step(
    place: ca.Function, tool: Composed, turn: Turn | None, s: float, after: float, q: Array
) -> Array:  # fmt: skip
    """Return q (n,) at the length `after`, from q at s."""
    h = after - s
    one = _slope(place, tool, turn, s, q)
    two = _slope(place, tool, turn, s + h / 2, q + h / 2 * one)
    three = _slope(place, tool, turn, s + h / 2, q + h / 2 * two)
    four = _slope(place, tool, turn, after, q + h * three)
    moved, there = q + h / 6 * (one + 2 * two + 2 * three + four), np.array([after])
    return np.asarray(settled(place, moved[None], tool.path(there, 0), None if turn is None else turn.at(there))[0])


def _slope(place: ca.Function, tool: Composed, turn: Turn | None, s: float, q: Array) -> Array:
    """Return dq/ds (n,), the least movement along the path."""
    wanted = tool.path(np.array([s]), 1)
    if turn is not None:
        wanted = np.hstack([wanted, turn.rate[None]])
    jacobian = matrices_of(evaluate(place, q[None])[2], len(q))
    return np.asarray(pulled(jacobian, Least(jacobian)(wanted))[0])


def of_arm(
    machine: Manipulator, path: ToolPath, law: Motion, choice: Choice, hold: Mapping[str, float] | None,
    rotation: object, knots: Array = NO_KNOTS,
) -> Motion:  # fmt: skip
    """Return the motion of a machine without inverse kinematics in closed form; arguments as of `along_tool_path`.

    Args:
        machine: of numbers.
        path, law, hold, rotation: as of `along_tool_path`.
        choice: beginning, limits and branch.
        knots: times at which higher derivatives of the path jump [s].
    """
    if hold or choice.branch is not None:
        given = "hold" if hold else "branch"
        raise ValueError(f"{given}: {machine.name} is an arm of links, whose beginning `near` chooses")
    low, high = choice.limits
    if np.all(np.isinf(low)) and np.all(np.isinf(high)) and "q" in machine.limits:
        low, high = (np.array(side, dtype=float) for side in machine.limits["q"])
    turn = orientation_along(rotation, path.length)
    curve, used, count = arm_curve(machine, Composed(path, law), path.length, turn, choice.begin, (low, high))
    notes = (f"inverse kinematics: solution {used} of {count} that were found at the start, nearest first",)
    times, breaks = np.union1d(law.times, knots), np.union1d(law.breaks, knots[1:-1])
    smoothness = min(law.smoothness, 3.0)
    return Motion(curve, law.start, law.end, labels_of(machine), smoothness, breaks, times, notes=notes)


def _at(point: Sequence[float] | Array) -> str:
    return f"the tool point ({', '.join(f'{x:.6g}' for x in point)}) m"
