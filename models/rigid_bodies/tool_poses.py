"""Inverse kinematics of any arm by damped Gauss-Newton steps from many starts: position, and orientation if wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.body_metrics import angular_velocity
from models.machines.inverse_kinematics import whole_turns, wrapped
from models.machines.manipulator import Manipulator
from models.rigid_bodies.orientations import Rotation, axis_angle, rotation_matrix
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import System

# Joints that slide are measured in dimensions of the arm, those that turn in rad.
STEPS = 60  # Gauss-Newton steps of one search
SAME = 1e-4  # coordinates of one solution differ by less
SPREAD = 0.3  # the same where solutions form curves, of which the nearest points of several starts differ a little
EXACT = 1e-9  # error of a solution
FLAT = 1e-5  # smallest singular value of the Jacobian of a solution that stands alone
HALF_TURN = 1e-9  # keeps the error of an orientation finite half a turn away
JUMP = 0.5  # largest step between points of a path


@dataclass(frozen=True, eq=False)
class _Task:
    """Where the tool of a machine shall be, as a function of many positions at once."""

    machine: Manipulator
    function: ca.Function  # q -> position, axes, Jacobians of both
    angular: Array  # (n,) whether a coordinate is an angle
    lower: Array  # (n,) limits, infinite where there are none
    upper: Array  # (n,)
    length: float  # dimensions of the arm [m]
    unit: Array  # (n,) 1 rad, or the dimensions of the arm
    redundant: bool  # whether the arm has more joints than conditions

    @staticmethod
    def of(machine: Manipulator, turned: bool, points: Array) -> _Task:
        q, axes = machine.q, machine.tool_orientation
        n = q.numel()
        turning = axes @ angular_velocity(axes, q) if turned else ca.SX(0, n)
        outputs = [machine.tool, ca.vec(ca.densify(axes)), ca.jacobian(machine.tool, q), turning]
        function = ca.Function("tool", [q], [ca.densify(output) for output in outputs])
        angular = np.array([coordinate.unit == "rad" for coordinate in machine.coordinates])
        low, high = machine.limits.get("q", ((-np.inf,) * n, (np.inf,) * n))
        lower, upper = np.array(low, dtype=float), np.array(high, dtype=float)
        least, most = _range(lower, upper, np.where(angular, np.pi, 0.0), np.zeros(n))
        sample = np.vstack([(least + most) / 2, np.random.default_rng(1).uniform(least, most, (64, n))])
        length = float(np.max(np.linalg.norm(evaluate(function, sample)[0], axis=1)))
        if np.any(np.isinf(upper - lower) & ~angular):  # an arm that reaches everything has the size of its task
            length = max(length, float(np.max(np.linalg.norm(points, axis=-1)))) or 1.0
        length = max(length, 1e-9)
        unit = np.where(angular, 1.0, length)
        return _Task(machine, function, angular, lower, upper, length, unit, n > (6 if turned else 3))

    def middle(self) -> Array:
        """Return the middle (n,) of the limits, 0 without limits."""
        least, most = self.range(np.zeros(len(self.unit)))
        return np.asarray((least + most) / 2)

    def range(self, near: Array) -> tuple[Array, Array]:
        """Return where starts are drawn from, (n,) each: the limits, or as far from `near` as the arm is large."""
        return _range(self.lower, self.upper, np.where(self.angular, np.pi, 2.0 * self.length), near)

    def nearest(self, q: Array, near: Array) -> Array:
        """Return q (K, n) with the full turns that bring angles next to `near`, within the limits if that is possible.

        Args:
            q: (K, n).
            near: (n,), or (K, n).
        """
        turn = 2.0 * np.pi
        least, most = np.ceil((self.lower - q - 1e-9) / turn), np.floor((self.upper - q + 1e-9) / turn)
        turns = np.clip(np.round((near - q) / turn), least, np.maximum(least, most))
        return np.asarray(q + np.where(self.angular, turn * turns, 0.0))

    def inside(self, q: Array) -> Array:
        """Return which q (K, n) are within the limits."""
        slack = 1e-9 * self.unit
        return np.asarray(np.all((q >= self.lower - slack) & (q <= self.upper + slack), axis=1))

    def errors(self, q: Array, position: Array, rotation: Array | None) -> tuple[Array, Array]:
        """Return the errors (K, m) of the tool at q (K, n), lengths as share of those of the arm, and Jacobians."""
        point, axes, slope, turning = evaluate(self.function, q)
        n = q.shape[1]
        error, jacobian = (position - point) / self.length, slope.reshape(-1, n, 3).swapaxes(1, 2) / self.length
        if rotation is None:
            return error, jacobian
        relative = rotation @ axes.reshape(-1, 3, 3)  # rows are the columns of R, so that this is target R'
        turned = turning.reshape(-1, n, 3).swapaxes(1, 2)
        return np.hstack([error, axis_angle(relative)]), np.concatenate([jacobian, turned], axis=1)


def inverse_kinematics(
    machine: Manipulator,
    position: Sequence[float] | Array,
    rotation: Rotation | None = None,
    *,
    near: Sequence[float] | Array | None = None,
    starts: int = 128,
    seed: int = 0,
) -> Array:
    """Return the positions of the joints with the tool at a point, all branches that are found within the limits.

    Angles are those of the full turn nearest to `near`. An arm with more joints than conditions has solutions without
    number, and so has a singular pose; of each branch the one nearest to `near` is returned. The search is numerical: a
    branch may be missed, more starts find more. What is returned is correct to 1e-9 of the length of the arm and 1e-9
    rad.

    Args:
        machine: any Manipulator.
        position: (3,) of the tool [m].
        rotation: axes of the tool in the base: roll, pitch, yaw [rad], or a matrix (3, 3); None for any.
        near: (n,) position to be near to; None is the middle of the limits.
        starts: number of random starts.
        seed: of the random starts.

    Returns:
        (m, n) solutions, the one nearest to `near` first; (0, n) if none is found.

    Raises:
        ValueError: the machine has parameters that stay symbols, or an argument has a wrong size.

    Source: T. Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE Trans.
        Robotics 27 (2011).
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as robots.ur5()")
    if machine.symbols:
        raise ValueError(f"machine: the parameters {', '.join(machine.symbols)} stay symbols; give numbers instead")
    point = checks.column("position", position, 3, "three numbers in m")
    wanted = None if rotation is None else rotation_matrix(rotation)
    count = checks.whole("starts", starts, 1, 100_000)
    task = _Task.of(machine, wanted is not None, point)
    n = len(machine.coordinates)
    named = f"{n} numbers, one for each joint of {machine.name}"
    centre = task.middle() if near is None else checks.column("near", near, n, named)
    random = np.random.default_rng(checks.whole("seed", seed, 0))
    q = np.vstack([centre, random.uniform(*task.range(centre), (count, n))])
    q = _searched(task, q, point, wanted, centre if task.redundant else None)
    q, loose = _solutions(task, q, point, wanted)
    if np.any(loose) and not task.redundant:
        begin = task.nearest(q[loose], centre)
        moved, _ = _solutions(task, _searched(task, begin, point, wanted, centre), point, wanted)
        q, loose = np.vstack([q[~loose], moved]), np.repeat([False, True], [np.sum(~loose), len(moved)])
    q = task.nearest(q, centre)
    inside = task.inside(q)
    q, loose = q[inside], loose[inside]
    order = np.argsort(np.linalg.norm((q - centre) / task.unit, axis=1), kind="stable")
    return _distinct(task, q[order], np.where(loose[order] | task.redundant, SPREAD, SAME))


def along_poses(
    machine: Manipulator,
    positions: Sequence[Sequence[float]] | Array,
    rotations: Sequence[Rotation] | Array | None = None,
    *,
    near: Sequence[float] | Array | None = None,
) -> Array:
    """Return positions of the joints along a path of the tool that never jump.

    Of the solutions at the first point the one nearest to `near` is continued, from full turns away where the limits
    need it; if it ends at a limit or a singularity the next one is tried.

    Args:
        machine: any Manipulator.
        positions: (K, 3) of the tool [m].
        rotations: (K, 3) roll, pitch, yaw [rad] or (K, 3, 3) axes of the tool; None for any.
        near: (n,) where the path should begin.

    Returns:
        (K, n).

    Raises:
        ValueError: no branch reaches all points without a jump; the message says how far the best one comes.
    """
    points = checks.numbers("positions", positions, "(K, 3) numbers in m")
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise checks.refused("positions", positions, "(K, 3) numbers in m")
    axes = (
        None
        if rotations is None
        else [rotation_matrix(one) for one in checks.several("rotations", rotations, "K rotations")]
    )
    if axes is not None and len(axes) != len(points):
        raise checks.refused("rotations", rotations, f"{len(points)} rotations, one for each position")
    begins = inverse_kinematics(machine, points[0], None if axes is None else axes[0], near=near)
    if not len(begins):
        raise ValueError(
            f"positions: the first one, {checks.shown(points[0].tolist())} m, cannot be reached within the limits"
        )
    task, reached = _Task.of(machine, axes is not None, points), 0
    for begin in begins:
        path = _followed(task, begin, points, axes)
        if len(path) == len(points):
            return path
        reached = max(reached, len(path))
    where = checks.shown(points[reached].tolist())
    raise ValueError(
        f"positions: every branch jumps, ends or leaves the limits at point {reached + 1} of {len(points)}, {where} m; "
        "give points that are closer, or keep away from singularities"
    )


def _followed(task: _Task, begin: Array, points: Array, axes: Sequence[Array] | None) -> Array:
    """Return the path (k, n) that begins at `begin` or full turns away, as far as it goes within the limits."""
    path, shift, least, most = [begin], np.zeros(len(begin)), begin, begin
    for k in range(1, len(points)):
        target = None if axes is None else axes[k]
        q = _searched(task, path[-1][None], points[k], target, path[-1] if task.redundant else None)
        error, _ = task.errors(q, points[k], target)
        least, most = np.minimum(least, q[0]), np.maximum(most, q[0])
        turns = whole_turns(least, most, task.angular, (task.lower, task.upper), 1e-9 * task.unit)
        if np.max(np.abs(error)) > EXACT or np.max(np.abs(q[0] - path[-1]) / task.unit) > JUMP or turns is None:
            break
        path.append(q[0])
        shift = turns
    return np.array(path) + shift


def orientation_error(system: System, rotation: Rotation) -> ca.SX:
    """Return the expression (3,) that vanishes where the tool has an orientation, for end(...), start(...), along(...).

    It is 2 sin(angle / 2) times the axis of the rotation that is missing, which vanishes there only.

    Args:
        system: a form of an arm of links, with the signal "tool_axes".
        rotation: roll, pitch, yaw [rad], or a matrix (3, 3): axes of the tool in the base.

    Raises:
        ValueError: the system has no signal "tool_axes".
    """
    checks.instance("system", system, System, "a System, a form of an arm of links")
    if "tool_axes" not in system.signals:
        raise ValueError("system: it has no signal 'tool_axes'; give a form of an arm of links such as robots.ur5()")
    missing = ca.DM(rotation_matrix(rotation).tolist()).T @ ca.reshape(system["tool_axes"], 3, 3)
    # The vector of the skew part is sin(angle) times the axis, 1 + trace is 4 cos(angle / 2)^2.
    skew = ca.vertcat(missing[2, 1] - missing[1, 2], missing[0, 2] - missing[2, 0], missing[1, 0] - missing[0, 1])
    return skew / ca.sqrt(1.0 + ca.trace(missing) + HALF_TURN)


def _range(lower: Array, upper: Array, span: Array, near: Array) -> tuple[Array, Array]:
    """Return lower and upper ends (n,), those that are infinite a span beyond the other end or beyond `near`."""
    least = np.where(np.isfinite(lower), lower, np.minimum(near, upper) - span)
    most = np.where(np.isfinite(upper), upper, np.maximum(near, lower) + span)
    return least, most


def _searched(task: _Task, q: Array, position: Array, rotation: Array | None, near: Array | None) -> Array:
    """Return q (K, n) after damped Gauss-Newton steps; with `near` arms move towards it where the tool allows it."""
    n, unit = q.shape[1], task.unit
    low, high = (np.where(task.angular, end, limit) for end, limit in ((-np.inf, task.lower), (np.inf, task.upper)))
    for step in range(STEPS):
        error, jacobian = task.errors(q, position, rotation)
        jacobian = jacobian * unit
        damping = 0.5 * np.sum(error**2, axis=1) + 1e-15
        normal = jacobian.swapaxes(1, 2) @ jacobian + damping[:, None, None] * np.eye(n)
        change = np.linalg.solve(normal, jacobian.swapaxes(1, 2) @ error[..., None])[..., 0]
        if near is not None and step < STEPS - 15:
            pull = 0.2 * (near - q) / unit
            across = np.linalg.solve(
                jacobian @ jacobian.swapaxes(1, 2) + 1e-9 * np.eye(jacobian.shape[1]), jacobian @ pull[..., None]
            )
            change = change + pull - (jacobian.swapaxes(1, 2) @ across)[..., 0]
        largest = np.max(np.abs(change), axis=1, keepdims=True)
        q = np.clip(q + change * np.minimum(1.0, 0.7 / np.maximum(largest, 1e-300)) * unit, low, high)
        if near is None and np.max(np.abs(change)) < 1e-14:
            break
    return q


def _solutions(task: _Task, q: Array, position: Array, rotation: Array | None) -> tuple[Array, Array]:
    """Return those of q (K, n) that are solutions, and which of them are singular, so that they may form a curve."""
    error, jacobian = task.errors(q, position, rotation)
    good = np.max(np.abs(error), axis=1) < EXACT
    smallest = np.linalg.svd(jacobian[good] * task.unit, compute_uv=False)[:, -1]
    return q[good], smallest < FLAT


def _distinct(task: _Task, q: Array, tolerances: Array) -> Array:
    """Return the first of all q (K, n) that differ by less than their tolerance (K,), full turns left out."""
    kept: list[Array] = []
    for one, tolerance in zip(q, tolerances, strict=True):
        steps = ((one - other) / task.unit for other in kept)
        if all(np.max(np.abs(np.where(task.angular, wrapped(step), step))) > tolerance for step in steps):
            kept.append(one)
    return np.array(kept).reshape(-1, q.shape[1])
