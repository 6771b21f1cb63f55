"""Motions of the tool along a path in space: inverse kinematics in closed form, or least movement of an arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from models.machines.inverse_kinematics import Configurations, Inverse, wrapped
from models.machines.manipulator import Manipulator
from models.motions.arm_tool_motion import of_arm
from models.motions.coordinate_labels import labels_of
from models.motions.latest_derivatives import remembered
from models.motions.motion import Motion
from models.motions.piecewise import Piecewise
from models.motions.recording import check_rows
from models.motions.splines import Ends, at_rest, interpolate
from models.motions.timing_laws import Composed, check_law
from models.motions.tool_branches import COARSE, Choice, follow
from models.motions.tool_paths import Polynomial, ToolPath, is_moving_at_its_ends
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

NO_KNOTS = np.empty(0)
# A Jacobian whose smallest singular value is below this share of the largest is inverted in its range only.
RANK = 1e-9
OFF = 1e-6  # share of the velocity of the tool that may be missed in a singular position


@dataclass(frozen=True, eq=False)
class ToolCurve:
    """q(t) with tool(q(t)) = x(t); v, a and the jerk from J v = x', J a = x'' - J' v, and so on."""

    tool: Composed
    inverse: Inverse
    angular: Array
    active: tuple[int, ...]  # the three coordinates that place the tool
    grid: Array  # (G,) [s]
    chosen: Array  # (G, n)
    terms: ca.Function  # (q, v, a) -> J (3, 3), J' v, x''' - J jerk
    last: dict[str, Array] = field(default_factory=dict)  # times and derivatives of the last call

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        return remembered(self.last, t, order, self._derivatives)

    def _derivatives(self, t: Array, highest: int) -> list[Array]:
        """Return q, v, a, ... up to the highest order, (K, n) each."""
        near = np.stack([np.interp(t, self.grid, column) for column in self.chosen.T], axis=1)
        every = self.inverse(self.tool(t, 0)).q
        step = every - near[:, None]
        step = np.nan_to_num(np.where(self.angular, wrapped(step), step), nan=0.0)
        best = np.argmin(np.linalg.norm(step, axis=2), axis=1)
        q = near + step[np.arange(len(t)), best]
        v, a, jerk = np.zeros_like(q), np.zeros_like(q), np.zeros_like(q)
        for k, part in enumerate((v, a, jerk)[:highest], 1):
            jacobian, second, third = evaluate(self.terms, q, v, a)
            left = self.tool(t, k) - (0.0 if k == 1 else second if k == 2 else third)
            part[:, self.active] = _solve(jacobian.reshape(-1, 3, 3).swapaxes(1, 2), left)
        return [q, v, a, jerk][: highest + 1]


def along_tool_path(
    machine: Manipulator,
    path: ToolPath,
    law: Motion,
    *,
    near: Sequence[float] | Array | None = None,
    hold: Mapping[str, float] | None = None,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
    branch: str | None = None,
    rotation: object = None,
) -> Motion:
    """Return the motion whose tool runs along a path in space.

    Of all solutions of the inverse kinematics the sequence is chosen that turns the least and never jumps. They are
    followed at as many times as they need, however short a fast part of a long motion is.

    An arm of links begins with the solution that is nearest to `near` (or to the middle of its limits) and can follow
    the path; joints that are left over move as little as they can, v = J^+ (x', omega). Without a `rotation` the tool
    may turn as it likes.

    Args:
        machine: any, its parameters numbers.
        path: made by line, arc or sampled.
        law: s(t), the length run through [m], a motion of one coordinate such as
            Motion.trapezoidal(0, path.length, 0.5, 2.0).
        near: (n,) position near which the motion should begin.
        hold: values of coordinates that do not move the tool, by name; 0 for those not given; not for arms of links.
        limits: lower and upper (n,) of the coordinates; None: none, for arms of links those of the machine.
        branch: name of the only branch of solutions to be used; None: all. A wrong name lists the right ones, and the
            notes of the motion tell the branch that was used. Not for arms of links.
        rotation: axes of the tool in the base, kept along the path: roll, pitch, yaw [rad] or a matrix (3, 3); or a
            tuple of two of these, from and to, between which it turns in proportion to the length. For arms of links.

    Raises:
        ValueError: a point that cannot be reached, no continuous solution within the limits, or a singularity
            through which the machine cannot follow the path; the message says where and which.
    """
    check_machine(machine)
    checks.instance("law", law, Motion, "a motion s(t) of one coordinate")
    if isinstance(path, type) or not callable(path) or not hasattr(path, "length"):
        raise TypeError(f"path: got {checks.shown(path)}, expected a path such as line(start, end)")
    check_law(law, 0.0, path.length)
    choice = Choice.of(machine, near, limits, branch)
    if machine.inverse is None:
        return of_arm(machine, path, law, choice, hold, rotation)
    if rotation is not None:
        raise checks.refused("rotation", rotation, f"None, as {machine.name} has no joints to turn its tool")
    return _along(machine, path, law, choice, hold)


def through_tool_points(
    machine: Manipulator,
    times: Sequence[float] | Array,
    points: Sequence[Sequence[float]] | Array,
    *,
    near: Sequence[float] | Array | None = None,
    hold: Mapping[str, float] | None = None,
    limits: tuple[Sequence[float], Sequence[float]] | None = None,
    branch: str | None = None,
    ends: Ends | None = None,
    rotation: object = None,
) -> Motion:
    """Return the motion whose tool passes points at given times, along a quintic spline.

    Args:
        machine: with inverse kinematics.
        times: (K,) increasing [s], counted from the first.
        points: (K, 3) of the tool [m].
        near, hold, limits, branch, rotation: as for `along_tool_path`.
        ends: of the spline, such as not_a_knot() for points of a motion that goes on; None: from rest to rest, with a
            note if the points move at their ends.

    Raises:
        ValueError: as `along_tool_path`; shapes that disagree, times that do not increase.
    """
    given = check_rows("times", times, "points", points)
    if given.q.shape[1] != 3:
        raise ValueError(f"points: got the shape {given.q.shape}, expected (K, 3)")
    since = given.t - given.t[0]
    path = Polynomial(interpolate(since, given.q, 5, at_rest(5) if ends is None else ends), float(since[-1]))
    # The time itself is the parameter of the path.
    law = Motion.of_time(lambda t: t, path.length, smoothness=4)
    check_machine(machine)
    choice = Choice.of(machine, near, limits, branch)
    if machine.inverse is None:
        motion = of_arm(machine, path, law, choice, hold, rotation, since)
    elif rotation is not None:
        raise checks.refused("rotation", rotation, f"None, as {machine.name} has no joints to turn its tool")
    else:
        motion = _along(machine, path, law, choice, hold, since)
    if ends is None and is_moving_at_its_ends(given.t, given.q):
        note = "the points move at their ends, but are passed from rest to rest: torques there are those of a jerk"
        return replace(motion, notes=(*motion.notes, f"{note}; ends=not_a_knot() avoids it"))
    return motion


def check_machine(machine: Manipulator) -> None:
    """Raise unless a machine has inverse kinematics of numbers."""
    checks.instance("machine", machine, Manipulator, "a Manipulator such as spherical()")
    if machine.symbols:
        names = ", ".join(machine.symbols)
        raise ValueError(f"the parameters {names} stay symbols; a motion of the tool needs a machine of numbers")


def _along(
    machine: Manipulator,
    path: ToolPath,
    law: Motion,
    choice: Choice,
    hold: Mapping[str, float] | None,
    knots: Array = NO_KNOTS,
) -> Motion:
    assert machine.inverse is not None
    n = len(machine.coordinates)
    angular = np.array([c.unit == "rad" for c in machine.coordinates])
    tool = Composed(path, law)
    first = np.unique(np.concatenate([np.linspace(law.start, law.end, COARSE), law.times, knots]))
    pieces = path.curve.breaks.size if isinstance(getattr(path, "curve", None), Piecewise) else 1  # type: ignore[attr-defined]
    result = follow(
        tool, machine.inverse, angular, first=first, pieces=pieces, begin=choice.begin, limits=choice.limits,
        branch=choice.branch,
    )  # fmt: skip
    points, configurations, chosen = result.points, result.configurations, result.q
    lost = np.flatnonzero(~configurations.reachable)
    if len(lost):
        k = int(lost[0])
        raise ValueError(f"{_where(points[k], result.t[k])} cannot be reached: {configurations.why(k)}")
    redundant = [i for i in range(n) if np.all(np.isnan(configurations.q[:, :, i])) and i not in _moving(machine)]
    held = _held(machine, redundant, {} if hold is None else hold)
    for i, value in held.items():
        chosen[:, i] = value
    if not np.all(np.isfinite(chosen)):
        raise ValueError("no solution of the inverse kinematics stays within the limits of the coordinates")
    if result.jump is not None:
        k = result.jump
        at = configurations.singularities(k) or configurations.singularities(k + 1) or ("no singularity",)
        raise ValueError(f"{_where(points[k], result.t[k])}: every solution jumps there ({', '.join(at)})")
    active = tuple(i for i in range(n) if i not in held)
    curve = ToolCurve(tool, machine.inverse, angular, active, result.t, chosen, _terms(machine, active))
    _check_velocities(curve, configurations, points)
    notes: tuple[str, ...] = ()
    if len(configurations.branches) > 1:
        used, every = (", then ".join(result.branches), "; ".join(configurations.branches))
        notes = (f"inverse kinematics: {used} (of the branches {every})",)
    times, breaks = np.union1d(law.times, knots), np.union1d(law.breaks, knots[1:-1])
    smoothness = min(law.smoothness, 3.0)
    return Motion(curve, law.start, law.end, labels_of(machine), smoothness, breaks, times, notes=notes)


def _check_velocities(curve: ToolCurve, configurations: Configurations, points: Array) -> None:
    """Raise ValueError for a path that needs velocities of the tool outside of the range of the Jacobian."""
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
