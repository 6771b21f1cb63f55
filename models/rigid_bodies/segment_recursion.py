"""Recursions for a machine with a metric in closed form, from its joints and links in a row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from models.machines.factorisation import Factors, factorise
from models.machines.manipulator import Manipulator
from models.machines.recursion import Build, Load, Recursion
from models.machines.segments import chain_of
from models.rigid_bodies.inertia import LinkInertia
from models.rigid_bodies.scalars import Entry, Vector, apply, identity, numeric, snapped, transposed
from models.rigid_bodies.tree import Pose, Tree, TreeJoint, turned_to
from models.rigid_bodies.tree_recursion import TreeRecursion, entries


def recursion_of(machine: Manipulator) -> Recursion | None:
    """Return the recursion over the segments of a machine; None for a machine that is not known by segments.

    Args:
        machine: such as spherical(); its coordinates may have another order than its joints.
    """
    chain = chain_of(machine)
    if chain is None:
        return None
    bodies, joints = {body.name: body for body in machine.bodies}, list[TreeJoint]()
    poses, back, names = list[Pose](), identity(), list[str]()
    for i, segment in enumerate(chain.segments):
        axes = turned_to(segment.axis)
        own, frame = transposed(snapped(axes)), snapped(numeric(back) @ axes)
        inertia = LinkInertia.zero()
        if segment.body is not None:
            body = bodies[segment.body]
            tensor = [entries(ca.densify(body.inertia)[k, :].T) for k in range(3)]
            inertia = LinkInertia.of(_entry(body.mass), _entries(segment.centre), tensor).moved(own, [0.0] * 3)
        origin = apply(back, _entries(segment.origin))
        joints.append(TreeJoint(segment.coordinate, i - 1, segment.revolute, frame, origin, inertia))
        poses.append(Pose(i, own, [0.0] * 3))
        names.append(segment.coordinate if segment.body is None else segment.body)
        back = own
    tool = Pose(len(joints) - 1, back, apply(back, _entries(chain.tool)))
    places = [coordinate.name for coordinate in machine.coordinates]
    order = tuple(places.index(joint.name) for joint in joints)
    tree = Tree(tuple(joints), (tool, *poses))
    recursion = TreeRecursion(tree, ca.vertcat(*(machine.q[k] for k in order)), tuple(names))
    return recursion if order == tuple(range(len(order))) else Reordered(recursion, order)


@dataclass(frozen=True, eq=False)
class ReorderedBuild:
    """One way to solve with the metric, with coordinates in another order than the joints."""

    build: Build
    order: tuple[int, ...]  # coordinate of every joint

    @property
    def name(self) -> str:
        """Name of the algorithm."""
        return self.build.name

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 right."""
        return _back(self.build.solve(_sorted(right, self.order)), self.order)

    def velocities(self, w: ca.SX) -> ca.SX:
        """Return v = L'^-1 w."""
        return _back(self.build.velocities(_sorted(w, self.order)), self.order)

    def accelerations(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return a = M^-1 (tau - h - dU/dq)."""
        return _back(self.build.accelerations(_sorted(v, self.order), _sorted(tau, self.order), field), self.order)

    def frame_rate(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return D^-1 L^-1 (tau - h - dU/dq) + (dL'/dt) v."""
        return _back(self.build.frame_rate(_sorted(v, self.order), _sorted(tau, self.order), field), self.order)


@dataclass(frozen=True, eq=False)
class Reordered:
    """Recursions with coordinates in another order than the joints; implements `models.machines.recursion.Recursion`.

    Factors are eliminated in the order of the joints.
    """

    recursion: TreeRecursion
    order: tuple[int, ...]  # coordinate of every joint

    @property
    def metric(self) -> ca.SX:
        """(n, n) metric."""
        rows = _places(self.order)
        return self.recursion.metric[rows, rows]

    @property
    def pivots(self) -> ca.SX:
        """(n,) diagonal of D."""
        return _back(self.recursion.pivots, self.order)

    @property
    def builds(self) -> tuple[Build, ...]:
        """The algorithms there are."""
        return tuple(ReorderedBuild(build, self.order) for build in self.recursion.builds)

    @property
    def from_base(self) -> Build:
        """Composite bodies, eliminated from the base."""
        return ReorderedBuild(self.recursion.from_base, self.order)

    def factors(self, from_tip: bool) -> Factors:
        """Return M = L D L', eliminated from the tip or from the base."""
        return factorise(self.metric, tuple(reversed(self.order)) if from_tip else self.order)

    def momentum(self, v: ca.SX) -> ca.SX:
        """Return p = M v."""
        return _back(self.recursion.momentum(_sorted(v, self.order)), self.order)

    def kinetic_gradient(self, v: ca.SX, p: ca.SX | None) -> ca.SX:
        """Return dT/dq at constant v."""
        known = None if p is None else _sorted(p, self.order)
        return _back(self.recursion.kinetic_gradient(_sorted(v, self.order), known), self.order)

    def gravity(self, field: ca.SX) -> ca.SX:
        """Return dU/dq of the weight of all links."""
        return _back(self.recursion.gravity(field), self.order)

    def potential(self, field: ca.SX) -> ca.SX:
        """Return the potential energy of the weight of all links."""
        return self.recursion.potential(field)

    def inverse_dynamics(self, v: ca.SX, a: ca.SX | None, field: ca.SX) -> ca.SX:
        """Return M a + h + dU/dq."""
        own = None if a is None else _sorted(a, self.order)
        return _back(self.recursion.inverse_dynamics(_sorted(v, self.order), own, field), self.order)

    def loaded(self, loads: Sequence[Load]) -> Reordered:
        """Return the recursion with loads fixed to links."""
        return replace(self, recursion=self.recursion.loaded(loads))

    def with_rotors(self, metric: ca.SX, spins: ca.SX | None = None) -> Reordered:
        """Return the recursion with rotors of effects."""
        carried = None if spins is None else _sorted(spins, self.order)
        return replace(self, recursion=self.recursion.with_rotors(metric[list(self.order), list(self.order)], carried))


def _sorted(column: ca.SX, order: Sequence[int]) -> ca.SX:
    """Return a column (n,) with its entries in the order of the joints."""
    return ca.densify(column)[list(order)]


def _back(column: ca.SX, order: Sequence[int]) -> ca.SX:
    """Return a column (n,) with its entries in the order of the coordinates."""
    return column[_places(order)]


def _places(order: Sequence[int]) -> list[int]:
    """Return the joint of every coordinate."""
    return [order.index(k) for k in range(len(order))]


def _entry(value: ca.SX | float) -> Entry:
    return entries(value)[0] if isinstance(value, ca.SX) else float(value)


def _entries(values: Sequence[ca.SX | float]) -> Vector:
    return [_entry(value) for value in values]
