"""Recursions over the links of a tree: velocities, momenta, metric (composite bodies), inverse dynamics (RNEA)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from models.rigid_bodies.inertia import LinkInertia
from models.rigid_bodies.joint_motion import JointMotion, Motions
from models.rigid_bodies.scalars import (
    Entry,
    Vector,
    add,
    apply,
    cross,
    is_zero,
    mul,
    neg,
    negative,
    plus,
    product,
    scaled,
    scaled_matrix,
    skew,
    sub,
    symmetric,
    total,
    transposed,
)
from models.rigid_bodies.tree import Tree
from models.rigid_bodies.turning import Turning

Wrench = tuple[list[Entry], list[Entry]]  # angular part about the origin of a link, linear part


@dataclass(frozen=True, eq=False)
class Recursions:
    """A tree at symbolic coordinates. Quantities of link i are written in its frame, about its origin.

    Source: R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapters 5 and 6.
    """

    tree: Tree
    q: ca.SX  # (n,)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.tree.joints)

    @cached_property
    def parents(self) -> list[int]:
        """(n,) indices of the joints before, -1 for the base."""
        return [joint.parent for joint in self.tree.joints]

    @cached_property
    def children(self) -> list[list[int]]:
        """Indices of the joints that every link carries."""
        return [self.tree.children(i) for i in range(self.n)]

    @cached_property
    def all_motions(self) -> Motions:
        """Motions of all links, parallel axes fused."""
        return Motions.of(self.tree, ca.vertsplit(self.q))

    @property
    def motions(self) -> tuple[JointMotion, ...]:
        """Motion of every link in the frame of the link before."""
        return self.all_motions.motions

    @cached_property
    def inertias(self) -> list[LinkInertia]:
        """Inertia of every link in its frame; it moves where the frame keeps its orientation."""
        result = []
        for joint, turned in zip(self.tree.joints, self.all_motions.turned, strict=True):
            own = joint.inertia
            if turned is not None:
                own = LinkInertia(own.mass, turned.up(own.moment), turned.up_symmetric(own.tensor))
            result.append(own)
        return result

    @cached_property
    def composite(self) -> list[LinkInertia]:
        """Inertia of every link with all that it carries."""
        composite = list(self.inertias)
        for i in reversed(range(self.n)):
            parts = [self.inertias[i]]
            for c in self.children[i]:
                motion, child = self.motions[c], composite[c]
                moment = motion.up(child.moment)
                mixed = product(skew(moment), skew(motion.origin))
                steiner = total(mixed, transposed(mixed))
                tensor = total(motion.up_symmetric(child.tensor), negative(steiner))
                if not is_zero(child.mass):
                    arm = skew(motion.origin)
                    tensor = total(tensor, negative(scaled_matrix(child.mass, product(arm, arm))))
                raised = plus(moment, scaled(child.mass, motion.origin))
                parts.append(LinkInertia(child.mass, raised, symmetric(tensor)))
            composite[i] = sum(parts[1:], parts[0])
        return composite

    @cached_property
    def metric(self) -> list[list[Entry]]:
        """(n, n) metric by composite rigid bodies, with the inertia of rotors."""
        rows: list[list[Entry]] = [[0.0] * self.n for _ in range(self.n)]
        for i, (joint, body) in enumerate(zip(self.tree.joints, self.composite, strict=True)):
            x, y = body.moment[0], body.moment[1]
            if joint.revolute:
                moment, force = [body.tensor[k][2] for k in range(3)], [neg(y), x, 0.0]
            else:
                moment, force = [y, neg(x), 0.0], [0.0, 0.0, body.mass]
            rows[i][i] = add(moment[2] if joint.revolute else force[2], joint.rotor)
            a, spin = i, joint.spin
            while self.parents[a] >= 0:
                motion = self.motions[a]
                moment, force = motion.up_wrench(moment, force)
                if not is_zero(spin):
                    moment, spin = plus(moment, self._axis(i, spin)), 0.0
                a = self.parents[a]
                rows[i][a] = rows[a][i] = moment[2] if self.tree.joints[a].revolute else force[2]
        if self.tree.coupling is not None:
            rows = [plus(row, more) for row, more in zip(rows, self.tree.coupling, strict=True)]
        return rows

    def gravity(self, acceleration: Vector) -> list[Entry]:
        """Return dU/dq (n,) in a homogeneous field."""
        fields: list[list[Entry]] = []
        for i, motion in enumerate(self.motions):
            fields.append(motion.down(acceleration if self.parents[i] < 0 else fields[self.parents[i]]))
        forces = []
        for joint, body, field in zip(self.tree.joints, self.composite, fields, strict=True):
            turned = sub(mul(body.moment[1], field[0]), mul(body.moment[0], field[1]))
            forces.append(turned if joint.revolute else neg(mul(body.mass, field[2])))
        return forces

    def outward(self, v: Sequence[Entry]) -> list[Wrench]:
        """Return angular and linear velocity of every link for velocities v (n,)."""
        result: list[Wrench] = []
        for i in range(self.n):
            result.append(self.with_own(i, self.from_parent(i, result), v[i]))
        return result

    def from_parent(self, i: int, velocities: Sequence[Wrench]) -> Wrench:
        """Return the velocity that link i has from its parent alone."""
        p = self.parents[i]
        return ([0.0] * 3, [0.0] * 3) if p < 0 else self.motions[i].down_velocity(*velocities[p])

    def with_own(self, i: int, velocity: Wrench, v: Entry) -> Wrench:
        """Return a velocity with that of joint i added."""
        turning, moving = velocity
        if self.tree.joints[i].revolute:
            return [turning[0], turning[1], add(turning[2], v)], moving
        return turning, [moving[0], moving[1], add(moving[2], v)]

    def momenta(self, velocities: Sequence[Wrench], v: Vector, p: Vector | None = None) -> list[Wrench]:
        """Return angular and linear momentum of every link with all that it carries.

        Args:
            velocities: of the links, by `outward`.
            v: (n,) velocities of the joints.
            p: (n,) momenta of the joints where they are known; p_i less the momentum of the rotors is the component
                about (along) the axis, which then costs nothing.
        """
        result: list[Wrench] = [([0.0] * 3, [0.0] * 3)] * self.n
        for i in reversed(range(self.n)):
            angular, linear = self.inertias[i].momentum(*velocities[i])
            for c in self.children[i]:
                moment, force = self.motions[c].up_wrench(*result[c])
                angular, linear = plus(angular, moment, self._spinning(c, v[c])), plus(linear, force)
            if p is not None:
                known = sub(p[i], self._of_rotors(i, velocities, v))
                if self.tree.joints[i].revolute:
                    angular = [angular[0], angular[1], known]
                else:
                    linear = [linear[0], linear[1], known]
            result[i] = angular, linear
        return result

    def momentum(self, v: Vector) -> list[Entry]:
        """Return the momenta p = M v (n,) without building M."""
        velocities = self.outward(v)
        momenta = self.momenta(velocities, v)
        return [
            add((angular if joint.revolute else linear)[2], self._of_rotors(i, velocities, v))
            for i, (joint, (angular, linear)) in enumerate(zip(self.tree.joints, momenta, strict=True))
        ]

    def kinetic_gradient(self, v: Vector, p: Vector | None = None) -> list[Entry]:
        """Return dT/dq (n,) at constant velocities v.

        dT/dq_i = omega_y h_x - omega_x h_y + v_y f_x - v_x f_y about an axis, omega_y f_x - omega_x f_y along one, with
        the momentum (h, f) of all that link i carries.
        """
        velocities = self.outward(v)
        momenta = self.momenta(velocities, v, p)
        result = []
        for joint, (turning, moving), (h, f) in zip(self.tree.joints, velocities, momenta, strict=True):
            if joint.revolute:
                turned = sub(mul(turning[1], h[0]), mul(turning[0], h[1]))
                result.append(add(turned, sub(mul(moving[1], f[0]), mul(moving[0], f[1]))))
            else:
                result.append(sub(mul(turning[1], f[0]), mul(turning[0], f[1])))
        return result

    def inverse_dynamics(self, v: Vector, a: Vector | None = None, gravity: Vector = (0.0, 0.0, 0.0)) -> list[Entry]:
        """Return tau = M a + h(q, v) + dU/dq (n,) by the recursion of Newton and Euler.

        Args:
            v: (n,) velocities.
            a: (n,) accelerations; None is none, for h + dU/dq alone.
            gravity: (3,) acceleration of the field.

        Source: W. Khalil, J.-F. Kleinfinger, Minimum operations and minimum parameters of the dynamic models of tree
            structure robots, IEEE J. Robotics and Automation 3 (1987).
        """
        moving, states = list[list[Entry]](), list[Turning]()
        for i, motion in enumerate(self.motions):
            own = 0.0 if a is None else a[i]
            p = self.parents[i]
            w: list[Entry] = [0.0] * 3
            dw: list[Entry] = [0.0] * 3
            if p < 0:
                dv = motion.down([neg(g) for g in gravity])
            else:
                w, dw = motion.down(states[p].w), motion.down(states[p].dw)
                dv = motion.down(plus(moving[p], states[p].of(motion.origin)))
            if self.tree.joints[i].revolute:
                dw = [add(dw[0], mul(w[1], v[i])), sub(dw[1], mul(w[0], v[i])), add(dw[2], own)]
                w = [w[0], w[1], add(w[2], v[i])]
            else:
                x, y = mul(mul(2.0, w[1]), v[i]), mul(mul(2.0, w[0]), v[i])
                dv = [add(dv[0], x), sub(dv[1], y), add(dv[2], own)]
            states.append(Turning(w, dw))
            moving.append(dv)
        wrenches: list[Wrench] = [([0.0] * 3, [0.0] * 3)] * self.n
        tau: list[Entry] = [0.0] * self.n
        for i in reversed(range(self.n)):
            body, state, joint = self.inertias[i], states[i], self.tree.joints[i]
            moment = plus(state.turned(body.tensor), cross(body.moment, moving[i]))
            force = plus(scaled(body.mass, moving[i]), state.of(body.moment))
            for c in self.children[i]:
                carried, pulled = self.motions[c].up_wrench(*wrenches[c])
                moment, force = plus(moment, carried), plus(force, pulled)
                spin = self.tree.joints[c].spin
                if not is_zero(spin):
                    axis = self._axis(c, spin)
                    moment = plus(moment, scaled(v[c], cross(state.w, axis)))
                    moment = moment if a is None else plus(moment, scaled(a[c], axis))
            wrenches[i] = moment, force
            tau[i] = moment[2] if joint.revolute else force[2]
            if a is not None:
                tau[i] = add(tau[i], mul(joint.rotor, a[i]), *self._coupled(i, a))
            if not is_zero(joint.spin) and self.parents[i] >= 0:
                before = self.motions[i].down(states[self.parents[i]].dw)
                tau[i] = add(tau[i], mul(joint.spin, before[2]))
        return tau

    def _axis(self, i: int, size: Entry) -> list[Entry]:
        """Return a vector along the axis of joint i in the frame of its parent."""
        return apply(self.motions[i].rotation, [0.0, 0.0, size])

    def _spinning(self, i: int, v: Entry) -> list[Entry]:
        spin = self.tree.joints[i].spin
        return [0.0] * 3 if is_zero(spin) else self._axis(i, mul(spin, v))

    def _coupled(self, i: int, v: Vector) -> list[Entry]:
        coupling = self.tree.coupling
        return [] if coupling is None else [mul(x, y) for x, y in zip(coupling[i], v, strict=True)]

    def _of_rotors(self, i: int, velocities: Sequence[Wrench], v: Vector) -> Entry:
        """Return what rotors contribute to the momentum of joint i."""
        joint, p = self.tree.joints[i], self.parents[i]
        own = add(mul(joint.rotor, v[i]), *self._coupled(i, v))
        if is_zero(joint.spin) or p < 0:
            return own
        return add(own, mul(joint.spin, self.motions[i].down(velocities[p][0])[2]))
