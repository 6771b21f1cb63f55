"""A machine with a metric in closed form as joints and links in a row, for recursions where effects load its links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from models.machines.body_metrics import simplified

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
