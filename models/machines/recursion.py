"""What a machine without a metric in closed form offers instead: recursions over its links, and loads on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from models.machines.factorisation import Factors


@dataclass(frozen=True, eq=False)
class Load:
    """A rigid body that an effect fixes to a machine of links.

    Args:
        name: of the load.
        mass: [kg].
        offset: (3,) mass centre, from the tool point in the axes of the tool, or from the mass centre of the carrier in
            its axes [m].
        inertia: (3, 3) tensor about the mass centre, in these axes [kg m^2].
        carrier: name of a body; None is the tool.
    """

    name: str
    mass: ca.SX | float
    offset: ca.SX
    inertia: ca.SX
    carrier: str | None = None


class Build(Protocol):
    """One of several ways to solve with the metric M = L D L', eliminated from the tip."""

    @property
    def name(self) -> str:
        """Name of the algorithm, for notes."""

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 right (n,)."""

    def velocities(self, w: ca.SX) -> ca.SX:
        """Return v = L'^-1 w (n,)."""

    def accelerations(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return a = M^-1 (tau - h - dU/dq) (n,)."""

    def frame_rate(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return dw/dt = D^-1 L^-1 (tau - h - dU/dq) + (dL'/dt) v (n,) of w = L' v."""


class Recursion(Protocol):
    """Recursions over the links of a machine; fields are accelerations (3,), vectors have one entry for each joint."""

    @property
    def metric(self) -> ca.SX:
        """(n, n) metric by composite rigid bodies."""

    @property
    def pivots(self) -> ca.SX:
        """(n,) diagonal of D in M = L D L', eliminated from the tip."""

    @property
    def builds(self) -> tuple[Build, ...]:
        """The algorithms there are for this machine."""

    @property
    def from_base(self) -> Build:
        """Composite bodies, eliminated from the base, for the frame `ldl`."""

    def factors(self, from_tip: bool) -> Factors:
        """Return M = L D L', eliminated from the tip (U D U') or from the base."""

    def momentum(self, v: ca.SX) -> ca.SX:
        """Return p = M v."""

    def kinetic_gradient(self, v: ca.SX, p: ca.SX | None) -> ca.SX:
        """Return dT/dq at constant v; momenta p that are known shorten it."""

    def gravity(self, field: ca.SX) -> ca.SX:
        """Return dU/dq of the weight of all links."""

    def potential(self, field: ca.SX) -> ca.SX:
        """Return the potential energy of the weight of all links [J]."""

    def inverse_dynamics(self, v: ca.SX, a: ca.SX | None, field: ca.SX) -> ca.SX:
        """Return M a + h + dU/dq; without accelerations the part h + dU/dq."""

    def loaded(self, loads: Sequence[Load]) -> Recursion:
        """Return the recursion of the machine with loads fixed to it."""

    def with_rotors(self, metric: ca.SX, spins: ca.SX | None = None) -> Recursion:
        """Return the recursion with rotors: a constant (n, n) added to the metric, and N J (n,) of those carried."""
