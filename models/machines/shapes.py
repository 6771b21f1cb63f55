"""Capsules that move with the bodies of a machine, for collisions."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, eq=False)
class Shape:
    """A capsule: a straight line between two points and everything within a radius of it."""

    body: str  # name of the body that carries it
    start: ca.SX  # (3,) in the inertial frame, depends on q [m]
    end: ca.SX  # (3,)
    radius: float  # > 0 [m]
    length: float  # of the line [m]
