"""Motions of the tool along a path in space, by inverse kinematics in closed form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.inverse_kinematics import Configurations, Inverse, continuous, wrapped
from models.machines.manipulator import Manipulator
from models.motions.coordinate_labels import labels_of
from models.motions.motion import Motion
from models.motions.recording import check_rows
from models.motions.splines import at_rest, interpolate
from models.motions.timing_laws import Composed, check_law
from models.motions.tool_paths import Polynomial, ToolPath
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

FINE = 2001  # places at which the solution is chosen, at least
LEAP = 0.5  # largest step between two of them [rad or m]
# A Jacobian whose smallest singular value is below this share of the largest is inverted in its range only.
RANK = 1e-9
OFF = 1e-6  # share by which the velocity of the tool may be missed there


@dataclass(frozen=True, eq=False)
class ToolCurve:
    """q(t) with tool(q(t)) = x(t); v, a and the jerk from J v = x', J a = x'' - J' v, and so on."""

    tool: Composed
    inverse: Inverse
    angular: Array
    active: tuple[int, ...]  # the three coordinates that place the tool
    grid: Array  # (G,) [s]
    chosen: Array  # (G, n)
    terms: ca.Function  # (q, v, a) -> J (3, 3), J' v, what J jerk leaves of x'''

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        near = np.stack([np.interp(t, self.grid, column) for column in self.chosen.T], axis=1)
        all_of_them = self.inverse(self.tool(t, 0)).q
        step = all_of_them - near[:, None]
        step = np.nan_to_num(np.where(self.angular, wrapped(step), step), nan=0.0)
        best = np.argmin(np.linalg.norm(step, axis=2), axis=1)
        q = near + step[np.arange(len(t)), best]
        v, a, jerk = np.zeros_like(q), np.zeros_like(q), np.zeros_like(q)
        for k, part in enumerate((v, a, jerk)[:order], 1):
            jacobian, second, third = evaluate(self.terms, q, v, a)
            left = self.tool(t, k) - (0.0 if k == 1 else second if k == 2 else third)
            part[:, self.active] = _solve(jacobian.reshape(-1, 3, 3).swapaxes(1, 2), left)
        return np.asarray((q, v, a, jerk)[order])


def along_tool_path(
    machine: Manipulator,
    path: ToolPath,
    law: Motion,
    *,
    near: Sequence[float] | Array | None = None,
    hold: Mapping[str, float] | None = None,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
) -> Motion:
    """Return the motion whose tool runs along a path in space.

    Of all solutions of the inverse kinematics the sequence is chosen that turns the least and never jumps.

    Args:
        machine: with inverse kinematics.
        path: made by line, arc or sampled.
        law: s(t), the length run through [m], a motion of one coordinate such as
            Motion.trapezoidal(0, path.length, 0.5, 2.0).
        near: (n,) position near which the motion should begin.
        hold: values of coordinates that do not move the tool, by name; 0 where silent.
        limits: lower and upper (n,) of the coordinates.

    Raises:
        ValueError: a point that cannot be reached, no continuous solution within the limits, or a singularity that
            the tool does not pass in a direction the machine can follow; the message says where and which.
    """
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    checks.instance("law", law, Motion, "a motion s(t) of one coordinate")
    if isinstance(path, type) or not callable(path) or not hasattr(path, "length"):
        raise TypeError(f"path: got {checks.shown(path)}, expected a path such as line(start, end)")
    if machine.inverse is None:
        raise ValueError(f"{machine.name} has no inverse kinematics; give its motion in coordinates")
    if machine.symbols:
        names = ", ".join(machine.symbols)
        raise ValueError(f"the parameters {names} stay symbols; a motion of the tool needs a machine of numbers")
    check_law(law, 0.0, path.length)
    n = len(machine.coordinates)
    angular = np.array([c.unit == "rad" for c in machine.coordinates])
    tool = Composed(path, law)
    grid = np.unique(np.concatenate([np.linspace(law.start, law.end, FINE), law.times]))
    points = tool(grid, 0)
    configurations = machine.inverse(points)
    lost = np.flatnonzero(~configurations.reachable)
    if len(lost):
        k = int(lost[0])
        raise ValueError(f"{_where(points[k], grid[k])} cannot be reached: {configurations.why(k)}")
    redundant = [i for i in range(n) if np.all(np.isnan(configurations.q[:, :, i])) and i not in _moving(machine)]
    held = _held(machine, redundant, {} if hold is None else hold)
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    if limits is not None:
        if not isinstance(limits, tuple | list) or len(limits) != 2:
            raise checks.refused("limits", limits, f"lower and upper ({n},) of the coordinates")
        low, high = (checks.column("limits", side, n, finite=False) for side in limits)
    named = f"{n} finite numbers, one for each coordinate of {machine.name}"
    begin = None if near is None else checks.column("near", near, n, named)
    chosen = continuous(configurations, angular, begin, (low, high))
    for i, value in held.items():
        chosen[:, i] = value
    if not np.all(np.isfinite(chosen)):
        raise ValueError("no solution of the inverse kinematics stays within the limits of the coordinates")
    step = np.max(np.abs(np.diff(chosen, axis=0)), axis=1)
    if np.max(step) > LEAP:
        k = int(np.argmax(step))
        at = configurations.singularities(k) or configurations.singularities(k + 1) or ("no singularity",)
        raise ValueError(f"{_where(points[k], grid[k])}: every solution jumps there ({', '.join(at)})")
    active = tuple(i for i in range(n) if i not in held)
    curve = ToolCurve(tool, machine.inverse, angular, active, grid, chosen, _terms(machine, active))
    _check_velocities(curve, configurations, points)
    return Motion(curve, law.start, law.end, labels_of(machine), min(law.smoothness, 3.0), law.breaks, law.times)


def through_tool_points(
    machine: Manipulator,
    times: Sequence[float] | Array,
    points: Sequence[Sequence[float]] | Array,
    *,
    near: Sequence[float] | Array | None = None,
    hold: Mapping[str, float] | None = None,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
) -> Motion:
    """Return the motion whose tool passes points at given times, along a quintic spline from rest to rest.

    Args:
        machine: with inverse kinematics.
        times: (K,) increasing [s], counted from the first.
        points: (K, 3) of the tool [m].
        near, hold, limits: as for `along_tool_path`.

    Raises:
        ValueError: as `along_tool_path`; shapes that disagree, times that do not increase.
    """
    given = check_rows("times", times, "points", points)
    if given.q.shape[1] != 3:
        raise ValueError(f"points: got the shape {given.q.shape}, expected (K, 3)")
    since = given.t - given.t[0]
    path = Polynomial(interpolate(since, given.q, 5, at_rest(5)), float(since[-1]))
    # The time itself is the parameter of the path.
    law = Motion.of_time(lambda t: t, path.length, smoothness=4)
    return along_tool_path(machine, path, law, near=near, hold=hold, limits=limits)


def _check_velocities(curve: ToolCurve, configurations: Configurations, points: Array) -> None:
    """Refuse a path that asks for more than the Jacobian can give."""
    t = curve.grid
    q, v = curve(t, 0), curve(t, 1)
    jacobian = evaluate(curve.terms, q, v, np.zeros_like(v))[0].reshape(-1, 3, 3).swapaxes(1, 2)
    wanted = curve.tool(t, 1)
    missed = np.linalg.norm(np.einsum("kij,kj->ki", jacobian, v[:, curve.active]) - wanted, axis=1)
    k = int(np.argmax(missed))
    if missed[k] > OFF * (1e-6 + np.max(np.linalg.norm(wanted, axis=1))):
        names = ", ".join(configurations.singularities(k)) or "a singularity"
        raise ValueError(f"{_where(points[k], t[k])} is singular ({names}), and the arm cannot follow its direction")


def _terms(machine: Manipulator, active: Sequence[int]) -> ca.Function:
    q, v = machine.q, machine.v
    a = ca.SX.sym("a", q.numel())
    jacobian = ca.jacobian(machine.tool, q)

    def rate(expression: ca.SX) -> ca.SX:
        return ca.jtimes(expression, ca.vertcat(q, v), ca.vertcat(v, a))

    first = jacobian @ v
    second = rate(first) - jacobian @ a  # J' v
    third = rate(rate(first))  # x''' without J jerk, as the rate of a is left out
    outputs = [ca.densify(part) for part in (jacobian[:, list(active)], second, third)]
    return ca.Function("terms", [q, v, a], ca.cse(outputs))


def _solve(jacobian: Array, right: Array) -> Array:
    """Return J^-1 right, in the range of J where it is singular."""
    sizes = np.linalg.svd(jacobian, compute_uv=False)
    regular = sizes[:, -1] > RANK * sizes[:, 0]
    result = np.empty_like(right)
    if np.any(regular):
        result[regular] = np.linalg.solve(jacobian[regular], right[regular][..., None])[..., 0]
    if not np.all(regular):
        inverse = np.linalg.pinv(jacobian[~regular], rcond=RANK)
        result[~regular] = np.einsum("kij,kj->ki", inverse, right[~regular])
    return result


def _moving(machine: Manipulator) -> set[int]:
    """Return the coordinates on which the tool depends."""
    sparsity = ca.jacobian(machine.tool, machine.q).sparsity()
    return {int(column) for column in sparsity.get_triplet()[1]}


def _held(machine: Manipulator, redundant: list[int], hold: Mapping[str, float]) -> dict[int, float]:
    names = [c.name for c in machine.coordinates]
    checks.mapping("hold", hold, "a dict coordinate -> value, or None")
    for name in hold:
        if name not in names or names.index(name) not in redundant:
            free = ", ".join(names[i] for i in redundant) or "no coordinate"
            raise ValueError(f"hold: {name!r} is fixed by the tool or unknown; there is {free} to be held")
    return {i: checks.number(f"hold: {names[i]}", hold.get(names[i], 0.0)) for i in redundant}


def _where(point: Array, t: float) -> str:
    return f"the tool point ({', '.join(f'{x:.6g}' for x in point)}) m at t = {t:.6g} s"
