"""Inverse kinematics of any arm by damped Gauss-Newton steps from many starts: position, and orientation if wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.body_metrics import angular_velocity
from models.machines.manipulator import Manipulator
from models.rigid_bodies.joint import Joint
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import System

STEPS = 60  # Gauss-Newton steps of one search
SAME = 1e-4  # coordinates of one solution differ by less [rad or m]
EXACT = 1e-9  # error of a solution [rad, and share of the dimensions of the arm]
JUMP = 0.5  # largest step of a coordinate between points of a path [rad or m]

Rotation = Sequence[float] | Sequence[Sequence[float]] | Array


@dataclass(frozen=True, eq=False)
class _Task:
    """Where the tool of a machine shall be, as a function of many positions at once."""

    machine: Manipulator
    function: ca.Function  # q -> position, axes, Jacobians of both
    angular: Array  # (n,) whether a coordinate is an angle
    lower: Array  # (n,)
    upper: Array  # (n,)
    length: float  # dimensions of the arm [m]

    @staticmethod
    def of(machine: Manipulator, turned: bool) -> _Task:
        q, axes = machine.q, machine.tool_orientation
        turning = axes @ angular_velocity(axes, q) if turned else ca.SX(0, q.numel())
        outputs = [machine.tool, ca.vec(ca.densify(axes)), ca.jacobian(machine.tool, q), turning]
        function = ca.Function("tool", [q], [ca.densify(output) for output in outputs])
        angular = np.array([coordinate.unit == "rad" for coordinate in machine.coordinates])
        low, high = machine.limits.get("q", ((-np.inf,) * len(angular), (np.inf,) * len(angular)))
        span = np.where(angular, np.pi, 1.0)
        lower = np.where(np.isfinite(low), low, -span)
        upper = np.where(np.isfinite(high), high, span)
        sample = np.vstack([(lower + upper) / 2, np.random.default_rng(1).uniform(lower, upper, (64, len(angular)))])
        length = float(np.max(np.linalg.norm(evaluate(function, sample)[0], axis=1)))
        return _Task(machine, function, angular, lower, upper, max(length, 1e-9))

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

    An arm with more joints than conditions has solutions without number; of each branch the one nearest to `near` is
    returned. The search is numerical: a branch may be missed, more starts find more. What is returned is correct to
    1e-9 of the length of the arm and 1e-9 rad.

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
    task = _Task.of(machine, wanted is not None)
    n = len(machine.coordinates)
    named = f"{n} numbers, one for each joint of {machine.name}"
    centre = (task.lower + task.upper) / 2 if near is None else checks.column("near", near, n, named)
    random = np.random.default_rng(checks.whole("seed", seed, 0))
    q = np.vstack([centre, random.uniform(task.lower, task.upper, (count, n))])
    redundant = n > (3 if wanted is None else 6)
    q = _searched(task, q, point, wanted, centre if redundant else None)
    error, _ = task.errors(q, point, wanted)
    q = _within(task, q[np.max(np.abs(error), axis=1) < EXACT])
    order = np.argsort(np.linalg.norm(q - centre, axis=1), kind="stable")
    # Solutions of a redundant arm form curves, of which the nearest points of several starts differ a little.
    return _distinct(q[order], 0.3 if redundant else SAME, task.angular)


def along_poses(
    machine: Manipulator,
    positions: Sequence[Sequence[float]] | Array,
    rotations: Sequence[Rotation] | Array | None = None,
    *,
    near: Sequence[float] | Array | None = None,
) -> Array:
    """Return positions of the joints along a path of the tool that never jump.

    Of the solutions at the first point the one nearest to `near` is continued; if it ends at a limit or a singularity
    the next one is tried.

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
    task, reached = _Task.of(machine, axes is not None), 0
    for begin in begins:
        path = [begin]
        for k in range(1, len(points)):
            target = None if axes is None else axes[k]
            redundant = len(begin) > (3 if axes is None else 6)
            q = _searched(task, path[-1][None], points[k], target, path[-1] if redundant else None)
            error, _ = task.errors(q, points[k], target)
            inside = np.all((q[0] >= task.lower - 1e-9) & (q[0] <= task.upper + 1e-9))
            if np.max(np.abs(error)) > EXACT or not inside or np.max(np.abs(q[0] - path[-1])) > JUMP:
                break
            path.append(q[0])
        if len(path) == len(points):
            return np.array(path)
        reached = max(reached, len(path))
    where = checks.shown(points[reached].tolist())
    raise ValueError(
        f"positions: every branch jumps, ends or leaves the limits at point {reached + 1} of {len(points)}, {where} m; "
        "give points that are closer, or keep away from singularities"
    )


def orientation_error(system: System, rotation: Rotation) -> ca.SX:
    """Return the expression (3,) that vanishes where the tool has an orientation, for end(...), start(...), along(...).

    It is sin(angle) times the axis of the rotation that is missing, so that it vanishes half a turn away as well: give
    an initial guess on the right side.

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
    skew = (missing - missing.T) / 2
    return ca.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])


def rotation_matrix(rotation: object) -> Array:
    """Return the matrix (3, 3) of roll, pitch, yaw [rad] or of a matrix."""
    return Joint("tool", rotation=rotation).turned()  # type: ignore[arg-type]


def _searched(task: _Task, q: Array, position: Array, rotation: Array | None, near: Array | None) -> Array:
    """Return q (K, n) after damped Gauss-Newton steps; redundant arms move towards `near` at the same time."""
    n = q.shape[1]
    low, high = task.lower - np.where(task.angular, np.pi, 0.0), task.upper + np.where(task.angular, np.pi, 0.0)
    for step in range(STEPS):
        error, jacobian = task.errors(q, position, rotation)
        damping = 0.5 * np.sum(error**2, axis=1) + 1e-15
        normal = jacobian.swapaxes(1, 2) @ jacobian + damping[:, None, None] * np.eye(n)
        change = np.linalg.solve(normal, jacobian.swapaxes(1, 2) @ error[..., None])[..., 0]
        if near is not None and step < STEPS - 15:
            pull = 0.2 * (near - q)
            across = np.linalg.solve(
                jacobian @ jacobian.swapaxes(1, 2) + 1e-9 * np.eye(jacobian.shape[1]), jacobian @ pull[..., None]
            )
            change = change + pull - (jacobian.swapaxes(1, 2) @ across)[..., 0]
        largest = np.max(np.abs(change), axis=1, keepdims=True)
        q = np.clip(q + change * np.minimum(1.0, 0.7 / np.maximum(largest, 1e-300)), low, high)
        if near is None and np.max(np.abs(change)) < 1e-14:
            break
    return q


def _within(task: _Task, q: Array) -> Array:
    """Return the solutions within the limits, full turns added to angles that are outside."""
    turns = np.where(task.angular, 2.0 * np.pi, 0.0)
    q = np.where(q > task.upper + 1e-9, q - turns, q)
    q = np.where(q < task.lower - 1e-9, q + turns, q)
    return q[np.all((q >= task.lower - 1e-9) & (q <= task.upper + 1e-9), axis=1)]


def _distinct(q: Array, tolerance: float, angular: Array) -> Array:
    kept: list[Array] = []
    for one in q:
        apart = (np.abs(np.where(angular, np.arcsin(np.sin((one - other) / 2.0)) * 2.0, one - other)) for other in kept)
        if all(np.max(distance) > tolerance for distance in apart):
            kept.append(one)
    return np.array(kept).reshape(-1, q.shape[1])


def axis_angle(rotation: Array) -> Array:
    """Return angle times axis (K, 3) of rotations (K, 3, 3)."""
    sine = np.stack([rotation[:, i, j] - rotation[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1) / 2.0
    size = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(size, (np.trace(rotation, axis1=1, axis2=2) - 1.0) / 2.0)
    factor = np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 1.0)
    result = sine * factor[:, None]
    half = (size <= 1e-9) & (angle > 1.0)
    if np.any(half):  # half a turn: the axis is a column of R + 1
        axis = rotation[half] + np.eye(3)
        best = np.argmax(np.linalg.norm(axis, axis=1), axis=1)
        column = axis[np.arange(len(axis)), :, best]
        result[half] = np.pi * column / np.linalg.norm(column, axis=1, keepdims=True)
    return np.asarray(result)
