"""The recursions of a tree as CasADi columns, with the algorithms to choose from and loads fixed to its links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca

from models.machines.factorisation import Factors, factorise
from models.machines.recursion import Build, Load
from models.rigid_bodies.articulated import Articulated
from models.rigid_bodies.inertia import LinkInertia
from models.rigid_bodies.recursions import Recursions
from models.rigid_bodies.scalars import Entry, add, column, div, dot, matrix_of, plus, scaled
from models.rigid_bodies.tree import Tree

MANY = 24  # joints above which the articulated-body algorithm is always the shorter one


def entries(expression: ca.SX | ca.DM) -> list[Entry]:
    """Return the components of a column; constants as numbers."""
    return [float(x) if x.is_constant() else x for x in ca.vertsplit(ca.densify(ca.SX(expression)))]


@dataclass(frozen=True, eq=False)
class CompositeBuild:
    """M by composite bodies, factorised as L D L' from the tip (or from the base, for the frame `ldl`)."""

    recursions: Recursions
    factors: Factors
    name: str = "composite rigid bodies"

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 right."""
        return self.factors.solve(right)

    def velocities(self, w: ca.SX) -> ca.SX:
        """Return v = L'^-1 w."""
        return self.factors.backward(w)

    def accelerations(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return a = M^-1 (tau - h - dU/dq)."""
        bias = column(self.recursions.inverse_dynamics(entries(v), None, entries(field)))
        return self.factors.solve(tau - bias)

    def frame_rate(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return D^-1 L^-1 (tau - h - dU/dq) + (dL'/dt) v."""
        q, symbol = self.recursions.q, ca.SX.sym("v", self.recursions.n)
        bias = column(self.recursions.inverse_dynamics(entries(v), None, entries(field)))
        turned = ca.jtimes(self.factors.lower.T @ symbol, q, symbol)
        return self.factors.forward(tau - bias) / self.factors.pivots + ca.substitute(turned, symbol, v)


@dataclass(frozen=True, eq=False)
class ArticulatedBuild:
    """The innovations factorisation in O(n), M never built."""

    articulated: Articulated
    name: str = "articulated bodies"

    def solve(self, right: ca.SX) -> ca.SX:
        """Return M^-1 right."""
        return column(self.articulated.solve(entries(right)))

    def velocities(self, w: ca.SX) -> ca.SX:
        """Return v = L'^-1 w."""
        return column(self.articulated.velocities(entries(w))[0])

    def accelerations(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return a = M^-1 (tau - h - dU/dq)."""
        return column(self.articulated.accelerations(entries(v), entries(tau), entries(field)))

    def frame_rate(self, v: ca.SX, tau: ca.SX, field: ca.SX) -> ca.SX:
        """Return D^-1 L^-1 (tau - h - dU/dq) + (dL'/dt) v."""
        bias = column(self.articulated.recursions.inverse_dynamics(entries(v), None, entries(field)))
        left = self.articulated.innovations(entries(tau - bias))
        own = [div(e, d) for e, d in zip(left, self.articulated.pivots, strict=True)]
        return column(own) + self.articulated.turning(v)


@dataclass(frozen=True, eq=False)
class TreeRecursion:
    """A tree in the frames of its user at symbolic coordinates; implements `models.machines.recursion.Recursion`.

    The first pose of the tree is the tool, then follows the frame of every link.
    """

    tree: Tree
    q: ca.SX  # (n,)
    names: tuple[str, ...]  # (n,) of the bodies

    @cached_property
    def recursions(self) -> Recursions:
        """Recursions in compact frames."""
        return Recursions(self.tree.compact(), self.q)

    @cached_property
    def metric(self) -> ca.SX:
        """(n, n) metric by composite rigid bodies."""
        return matrix_of(self.recursions.metric)

    @property
    def pivots(self) -> ca.SX:
        """(n,) diagonal of D in M = L D L', eliminated from the tip."""
        if self.recursions.n > MANY and Articulated.exists(self.recursions):
            return column(self._articulated.pivots)
        return self.factors(True).pivots

    @cached_property
    def builds(self) -> tuple[Build, ...]:
        """Composite bodies, and articulated bodies unless rotors couple the joints."""
        if not Articulated.exists(self.recursions):
            return (CompositeBuild(self.recursions, self.factors(True)),)
        articulated = ArticulatedBuild(self._articulated)
        if self.recursions.n > MANY:
            return (articulated,)
        return CompositeBuild(self.recursions, self.factors(True)), articulated

    @cached_property
    def _articulated(self) -> Articulated:
        return Articulated(self.recursions)

    @property
    def from_base(self) -> Build:
        """Composite bodies, eliminated from the base."""
        return CompositeBuild(self.recursions, self.factors(False))

    def factors(self, from_tip: bool) -> Factors:
        """Return M = L D L', eliminated from the tip or from the base."""
        return self._from_tip if from_tip else factorise(self.metric, range(self.recursions.n))

    @cached_property
    def _from_tip(self) -> Factors:
        return factorise(self.metric, range(self.recursions.n - 1, -1, -1))

    def momentum(self, v: ca.SX) -> ca.SX:
        """Return p = M v."""
        return column(self.recursions.momentum(entries(v)))

    def kinetic_gradient(self, v: ca.SX, p: ca.SX | None = None) -> ca.SX:
        """Return dT/dq at constant v."""
        return column(self.recursions.kinetic_gradient(entries(v), None if p is None else entries(p)))

    def gravity(self, field: ca.SX) -> ca.SX:
        """Return dU/dq."""
        return column(self.recursions.gravity(entries(field)))

    def potential(self, field: ca.SX) -> ca.SX:
        """Return U of the weight of all links, zero for all masses at the origin of the base."""
        r, g = self.recursions, entries(field)
        moment = list(r.tree.base.moment)
        for i in range(r.n):
            if r.parents[i] < 0:
                body, motion = r.composite[i], r.motions[i]
                moment = plus(moment, motion.up(body.moment), scaled(body.mass, motion.origin))
        return -ca.SX(dot(g, moment))

    def inverse_dynamics(self, v: ca.SX, a: ca.SX | None, field: ca.SX) -> ca.SX:
        """Return M a + h + dU/dq."""
        own = None if a is None else entries(a)
        return column(self.recursions.inverse_dynamics(entries(v), own, entries(field)))

    def loaded(self, loads: Sequence[Load]) -> TreeRecursion:
        """Return the recursion with loads fixed to the tool or to links.

        A load fixed to the base moves nothing and is left out.
        """
        joints, tool = list(self.tree.joints), self.tree.poses[0]
        for load in loads:
            tensor = [entries(ca.densify(load.inertia)[i, :].T) for i in range(3)]
            link = tool.link if load.carrier is None else self.names.index(load.carrier)
            rotation, origin = tool.rotation, list(tool.origin)
            if load.carrier is not None:
                rotation, origin = self.tree.poses[1 + link].rotation, self.centre(link)
            if link < 0:
                continue
            own = LinkInertia.of(_number(load.mass), entries(load.offset), tensor).moved(rotation, origin)
            joints[link] = replace(joints[link], inertia=joints[link].inertia + own)
        return replace(self, tree=replace(self.tree, joints=tuple(joints)))

    def centre(self, link: int) -> list[Entry]:
        """Return the mass centre of a link in its joint frame; the origin of a link without mass."""
        inertia = self.tree.joints[link].inertia
        if isinstance(inertia.mass, int | float) and inertia.mass == 0:
            return list(self.tree.poses[1 + link].origin)
        return [div(x, inertia.mass) for x in inertia.moment]

    def with_rotors(self, metric: ca.SX, spins: ca.SX | None = None) -> TreeRecursion:
        """Return the recursion with rotors of effects; one that the base carries does not turn with it."""
        joints, n = list(self.tree.joints), len(self.tree.joints)
        diagonal = bool(metric.sparsity().is_subset(ca.Sparsity.diag(n)))
        coupling = None if diagonal else [entries(ca.densify(metric)[i, :].T) for i in range(n)]
        for i in range(n):
            own = entries(metric[i, i])[0] if diagonal else 0.0
            joints[i] = replace(joints[i], rotor=add(joints[i].rotor, own))
            if spins is not None and joints[i].parent >= 0:
                joints[i] = replace(joints[i], spin=add(joints[i].spin, *entries(spins[i])))
        return replace(self, tree=replace(self.tree, joints=tuple(joints), coupling=coupling))


def _number(value: ca.SX | float) -> Entry:
    return entries(value)[0] if isinstance(value, ca.SX) else float(value)
