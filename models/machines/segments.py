"""A machine with a metric in closed form as joints and links in a row, for recursions where effects load its links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.machines.body_metrics import simplified
from models.machines.manipulator import Manipulator

Length = ca.SX | float


@dataclass(frozen=True, eq=False)
class Segment:
    """A joint and the body that it moves; the axes of the body are those of the segment before, turned by the joint.

    Args:
        coordinate: name of the coordinate of the joint.
        revolute: whether the joint turns about its axis; otherwise it moves along it.
        axis: (3,) unit vector in the axes of the segment before.
        origin: (3,) point on the axis, from the origin of the segment before, in its axes [m].
        body: name of the body that has these axes; None if there is none.
        centre: (3,) mass centre of the body from the origin of the segment, in its axes [m].
    """

    coordinate: str
    revolute: bool
    axis: Sequence[float]
    origin: Sequence[Length] = (0.0, 0.0, 0.0)
    body: str | None = None
    centre: Sequence[Length] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Chain:
    """Segments from the base to the tool, which has the axes of the last one."""

    segments: tuple[Segment, ...]
    tool: Sequence[Length]  # (3,) tool point from the origin of the last segment, in its axes [m]

    def turning(self, coordinates: Sequence[str], q: ca.SX) -> ca.SX:
        """Return (n, n) rows r_k with axis_k . omega = r_k v, omega the angular velocity of the segment before joint k.

        Args:
            coordinates: (n,) their names in the order of q.
            q: (n,) symbols.
        """
        n = q.numel()
        rows, omega = ca.SX(n, n), ca.SX(3, n)  # of the segment, in its axes
        for segment in self.segments:
            k, axis = coordinates.index(segment.coordinate), ca.sparsify(ca.SX(ca.DM(list(segment.axis))))
            rows[k, :] = axis.T @ omega
            if segment.revolute:
                cross = ca.sparsify(ca.skew(axis))
                turned = ca.SX.eye(3) - ca.sin(q[k]) * cross + (1 - ca.cos(q[k])) * (cross @ cross)
                omega = turned @ omega
                omega[:, k] = axis
        return simplified(rows, q)


def chain_of(machine: Manipulator) -> Chain | None:
    """Return the joints and links of a machine whose metric is given in closed form.

    None for a machine that is not one of the three of this program as it was made: metric and tool of the chain are
    compared with those of the machine at random positions.

    Args:
        machine: such as spherical().
    """
    make = MADE.get(machine.name)
    names = {coordinate.name for coordinate in machine.coordinates}
    if make is None or machine.recursion is not None:
        return None
    entries = {name: machine.symbols.get(name, value) for name, value in machine.nominal.items()}
    try:
        chain = make(entries)
    except KeyError:
        return None
    bodies = {segment.body for segment in chain.segments} - {None}
    same = {segment.coordinate for segment in chain.segments} == names
    return chain if same and bodies == {body.name for body in machine.bodies} and _agrees(machine, chain) else None


def _agrees(machine: Manipulator, chain: Chain) -> bool:
    """Return whether a chain has the metric and the tool of a machine."""
    q, n = machine.q, machine.q.numel()
    coordinates = [coordinate.name for coordinate in machine.coordinates]
    bodies = {body.name: body for body in machine.bodies}
    metric, turned, at = ca.SX(n, n), ca.SX.eye(3), ca.SX(3, 1)
    turning, angular = ca.SX(3, n), []
    for segment in chain.segments:
        k, axis = coordinates.index(segment.coordinate), ca.DM(list(segment.axis))
        at = at + turned @ ca.vertcat(*segment.origin)
        if segment.revolute:
            cross = ca.skew(axis)
            turning = ca.SX(turning)
            turning[:, k] = turned @ axis
            turned = turned @ (ca.SX.eye(3) + ca.sin(q[k]) * cross + (1 - ca.cos(q[k])) * (cross @ cross))
        else:
            at = at + turned @ axis * q[k]
        if segment.body is not None:
            body = bodies[segment.body]
            centre = at + turned @ ca.vertcat(*segment.centre)
            slope, spin = ca.jacobian(centre, q), turned.T @ turning
            metric = metric + body.mass * (slope.T @ slope) + spin.T @ body.inertia @ spin
            angular.append(ca.sumsqr(body.orientation - turned) + ca.sumsqr(body.centre - centre))
    tool = at + turned @ ca.vertcat(*chain.tool)
    off = [ca.vec(ca.densify(metric - machine.metric)), tool - machine.tool, *angular]
    inputs = ca.vertcat(q, *machine.symbols.values())
    values = np.random.default_rng(7).uniform(0.3, 1.7, (inputs.numel(), 3))
    outputs = [ca.densify(ca.vertcat(*off)), ca.densify(ca.vec(machine.metric))]
    apart, size = (np.array(part) for part in ca.Function("off", [inputs], outputs).map(3)(values))
    return bool(np.max(np.abs(apart)) <= 1e-9 * (1.0 + np.max(np.abs(size))))


def _cylindrical(p: Mapping[str, Length]) -> Chain:
    segments = (
        Segment("phi", True, (0.0, 0.0, 1.0), body="column"),
        Segment("xi", False, (0.0, 0.0, 1.0), body="carriage", centre=(p["A"] / 2, 0.0, 0.0)),
        Segment("r", False, (0.0, 1.0, 0.0), (p["A"], 0.0, 0.0), "arm"),
    )
    return Chain(segments, (0.0, p["l_T"], 0.0))


def _spherical(p: Mapping[str, Length]) -> Chain:
    segments = (
        Segment("psi", True, (0.0, 0.0, 1.0), body="column"),
        Segment("theta", True, (-1.0, 0.0, 0.0), body="swivel", centre=(0.0, 0.0, p["s_2"])),
        Segment("phi", True, (0.0, 0.0, 1.0)),
        Segment("r", False, (0.0, 0.0, 1.0), body="arm"),
    )
    return Chain(segments, (0.0, 0.0, p["l_T"]))


def _torus(p: Mapping[str, Length]) -> Chain:
    inner, outer, tilt = p["L_2"], p["L_3"], (0.0, -1.0, 0.0)
    segments = (
        Segment("q1", True, (0.0, 0.0, 1.0), body="column"),
        Segment("q2", True, tilt, (0.0, p["B"], 0.0), "link 2", (inner / 2, 0.0, 0.0)),
        Segment("q3", True, tilt, (inner, 0.0, 0.0), "link 3", (outer / 2, 0.0, 0.0)),
    )
    return Chain(segments, (outer / 2 + p["l_T"], 0.0, 0.0))


MADE = {"cylindrical": _cylindrical, "spherical": _spherical, "torus": _torus}
