"""Articulated-body inertia of a tree: M = L D L' from the tip, and O(n) solutions without building M."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from models.rigid_bodies.recursions import Recursions, Wrench
from models.rigid_bodies.scalars import (
    Entry,
    Matrix,
    Vector,
    add,
    apply,
    column,
    cross,
    div,
    dot,
    is_zero,
    mul,
    neg,
    negative,
    plus,
    product,
    scaled,
    skew,
    sub,
    symmetric,
    total,
    transposed,
)

Blocks = tuple[Matrix, Matrix, Matrix]  # angular, mixed and linear block (3, 3) of a spatial inertia


@dataclass(frozen=True, eq=False)
class Articulated:
    """The innovations factorisation of a tree without coupled rotors.

    Source: A. Jain, G. Rodriguez, Diagonalized Lagrangian robot dynamics, IEEE Trans. Robotics and Automation 11
        (1995); R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapter 7.
    """

    recursions: Recursions

    @staticmethod
    def exists(recursions: Recursions) -> bool:
        """Whether the tree has no coupled rotors, whose momentum the recursion does not carry."""
        tree = recursions.tree
        return tree.coupling is None and all(is_zero(joint.spin) for joint in tree.joints)

    @cached_property
    def _factors(self) -> tuple[list[list[Entry]], list[Entry], list[Blocks]]:
        """Gains K (n of (6,)), pivots D (n,), and the inertia that the parent of every joint feels."""
        r = self.recursions
        gains: list[list[Entry]] = [[]] * r.n
        pivots: list[Entry] = [0.0] * r.n
        felt: list[Blocks] = [([], [], [])] * r.n
        for i in reversed(range(r.n)):
            body = r.inertias[i]
            linear: Matrix = [[body.mass if a == b else 0.0 for b in range(3)] for a in range(3)]
            angular, mixed = body.tensor, skew(body.moment)
            for c in r.children[i]:
                motion = r.motions[c]
                j, h, m = felt[c]
                j, h, m = motion.up_symmetric(j), motion.up_general(h), motion.up_symmetric(m)
                arm = skew(motion.origin)
                shifted = total(h, product(arm, m))
                j = total(j, negative(product(h, arm)), product(arm, transposed(shifted)))
                angular, mixed = symmetric(total(angular, symmetric(j))), total(mixed, shifted)
                linear = symmetric(total(linear, m))
            joint = r.tree.joints[i]
            if joint.revolute:
                force = [*(angular[a][2] for a in range(3)), *mixed[2]]
            else:
                force = [*(mixed[a][2] for a in range(3)), *(linear[a][2] for a in range(3))]
            pivots[i] = add(force[2 if joint.revolute else 5], joint.rotor)
            gains[i] = [div(x, pivots[i]) for x in force]
            felt[i] = self._reduced(i, (angular, mixed, linear), force, gains[i])
        return gains, pivots, felt

    def _reduced(self, i: int, blocks: Blocks, force: Vector, gain: Vector) -> Blocks:
        """Return I - U U' / D; the rotor keeps the component of the axis at rotor K."""
        angular, mixed, linear = blocks
        joint = self.recursions.tree.joints[i]
        own = 2 if joint.revolute else 5
        full: list[list[Entry]] = [[0.0] * 6 for _ in range(6)]
        for a in range(6):
            for b in range(a, 6):
                entry = angular[a][b] if b < 3 else mixed[a][b - 3] if a < 3 else linear[a - 3][b - 3]
                if own in (a, b):
                    full[a][b] = mul(joint.rotor, gain[b if a == own else a])
                else:
                    full[a][b] = sub(entry, mul(force[a], gain[b]))
                full[b][a] = full[a][b]
        return [row[:3] for row in full[:3]], [row[3:] for row in full[:3]], [row[3:] for row in full[3:]]

    @property
    def pivots(self) -> list[Entry]:
        """(n,) diagonal of D, the inertia of every joint with all beyond it free to move."""
        return self._factors[1]

    def innovations(self, p: Vector) -> list[Entry]:
        """Return L^-1 p (n,) by one sweep inwards."""
        r, (gains, _, _) = self.recursions, self._factors
        result: list[Entry] = [0.0] * r.n
        pending: list[list[Entry]] = [[0.0] * 6 for _ in range(r.n)]
        for i in reversed(range(r.n)):
            own = 2 if r.tree.joints[i].revolute else 5
            result[i] = sub(p[i], pending[i][own])
            carried = [add(pending[i][a], mul(gains[i][a], result[i])) for a in range(6)]
            if is_zero(r.tree.joints[i].rotor):
                carried[own] = p[i]  # the gain is 1 there
            parent = r.parents[i]
            if parent >= 0:
                moment, force = r.motions[i].up_wrench(carried[:3], carried[3:])
                pending[parent] = plus(pending[parent], [*moment, *force])
        return result

    def velocities(self, w: Vector) -> tuple[list[Entry], list[Wrench]]:
        """Return v = L'^-1 w (n,) and the velocities of the links by one sweep outwards, v_i = w_i - K_i . V_i^-."""
        r, (gains, _, _) = self.recursions, self._factors
        v: list[Entry] = [0.0] * r.n
        links: list[Wrench] = []
        for i in range(r.n):
            turning, moving = r.from_parent(i, links)
            v[i] = sub(w[i], dot(gains[i], [*turning, *moving]))
            links.append(r.with_own(i, (turning, moving), v[i]))
        return v, links

    def solve(self, p: Vector) -> list[Entry]:
        """Return M^-1 p (n,)."""
        return self.velocities([div(e, d) for e, d in zip(self.innovations(p), self.pivots, strict=True)])[0]

    def turning(self, v: ca.SX) -> ca.SX:
        """Return (d L'/dt) v (n,) at the velocities v, expressions in q and other symbols."""
        r, (gains, _, _) = self.recursions, self._factors
        symbol = ca.SX.sym("v", r.n)
        links: list[Wrench] = []
        rows: list[Entry] = []
        for i, own in enumerate(ca.vertsplit(symbol)):
            turning, moving = r.from_parent(i, links)
            rows.append(dot(gains[i], [*turning, *moving]))
            links.append(r.with_own(i, (turning, moving), own))
        return ca.substitute(ca.jtimes(column(rows), r.q, symbol), symbol, v)

    def accelerations(self, v: Vector, tau: Vector, gravity: Vector) -> list[Entry]:
        """Return a = M^-1 (tau - h - dU/dq) (n,) by the articulated-body algorithm.

        Args:
            v: (n,) velocities.
            tau: (n,) forces on the joints.
            gravity: (3,) acceleration of the field.
        """
        r, (gains, pivots, felt) = self.recursions, self._factors
        links = r.outward(v)
        pending: list[list[Entry]] = [[0.0] * 6 for _ in range(r.n)]
        left: list[Entry] = [0.0] * r.n
        biases = [self._bias(i, links[i], v[i]) for i in range(r.n)]
        for i in reversed(range(r.n)):
            turning, moving = links[i]
            h, f = r.inertias[i].momentum(turning, moving)
            force = [*plus(cross(turning, h), cross(moving, f)), *cross(turning, f)]
            force = plus(force, pending[i])
            left[i] = sub(tau[i], force[2 if r.tree.joints[i].revolute else 5])
            parent = r.parents[i]
            if parent < 0:
                continue
            j, h_block, m = felt[i]
            turned, shifted = biases[i]
            moment = plus(apply(j, turned), apply(h_block, shifted))
            pulled = plus(apply(transposed(h_block), turned), apply(m, shifted))
            carried = plus(force, [*moment, *pulled], scaled(left[i], gains[i]))
            up, raised = r.motions[i].up_wrench(carried[:3], carried[3:])
            pending[parent] = plus(pending[parent], [*up, *raised])
        a: list[Entry] = [0.0] * r.n
        moved: list[Wrench] = []
        for i in range(r.n):
            p = r.parents[i]
            before: Wrench = ([0.0] * 3, [neg(g) for g in gravity]) if p < 0 else moved[p]
            turning, moving = r.motions[i].down_velocity(*before)
            turning, moving = plus(turning, biases[i][0]), plus(moving, biases[i][1])
            a[i] = sub(div(left[i], pivots[i]), dot(gains[i], [*turning, *moving]))
            moved.append(r.with_own(i, (turning, moving), a[i]))
        return a

    def _bias(self, i: int, velocity: Wrench, v: Entry) -> Wrench:
        """Return V x S v of joint i."""
        (w, u), zero = velocity, 0.0
        if self.recursions.tree.joints[i].revolute:
            return [mul(w[1], v), neg(mul(w[0], v)), zero], [mul(u[1], v), neg(mul(u[0], v)), zero]
        return [zero] * 3, [mul(w[1], v), neg(mul(w[0], v)), zero]
