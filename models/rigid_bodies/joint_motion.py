"""Rotation and position of one link in the frame of the link before, and the change of frame of its quantities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from models.rigid_bodies.joint import cosine_sine
from models.rigid_bodies.scalars import (
    Entry,
    Matrix,
    Vector,
    add,
    apply,
    cross,
    identity,
    is_zero,
    mul,
    numeric,
    plus,
    product,
    scaled,
    snapped,
    sub,
    symmetric,
    transposed,
)
from models.rigid_bodies.tree import Tree

FLAT = 1e-12  # an entry of a rotation below this is zero


@dataclass(frozen=True, eq=False)
class JointMotion:
    """x_parent = E Rz(angle) x_link + p, with the cosine and sine of the angle; (1, 0) for links that do not turn."""

    rotation: Matrix  # (3, 3) numbers E
    origin: Vector  # (3,) p
    cosine: Entry = 1.0
    sine: Entry = 0.0

    @property
    def turns(self) -> bool:
        """Whether the frame of the link turns in that of its parent."""
        return not is_zero(self.sine)

    def turned(self, a: Vector) -> list[Entry]:
        """Return Rz(angle) a."""
        c, s = self.cosine, self.sine
        return [sub(mul(c, a[0]), mul(s, a[1])), add(mul(s, a[0]), mul(c, a[1])), a[2]]

    def up(self, a: Vector) -> list[Entry]:
        """Return a vector of the link in the axes of the parent."""
        return apply(self.rotation, self.turned(a) if self.turns else a)

    def down(self, a: Vector) -> list[Entry]:
        """Return a vector of the parent in the axes of the link."""
        a = apply(transposed(self.rotation), a)
        if not self.turns:
            return a
        c, s = self.cosine, self.sine
        return [add(mul(c, a[0]), mul(s, a[1])), sub(mul(c, a[1]), mul(s, a[0])), a[2]]

    def up_wrench(self, moment: Vector, force: Vector) -> tuple[list[Entry], list[Entry]]:
        """Return moment and force (or angular and linear momentum) about the origin of the parent."""
        raised = self.up(force)
        return plus(self.up(moment), cross(self.origin, raised)), raised

    def down_velocity(self, turning: Vector, moving: Vector) -> tuple[list[Entry], list[Entry]]:
        """Return the velocity of the parent at the origin of the link, in its axes."""
        return self.down(turning), self.down(plus(moving, cross(turning, self.origin)))

    def up_symmetric(self, a: Matrix) -> list[list[Entry]]:
        """Return R a R' of a symmetric matrix, with the double angle instead of two rotations."""
        rows: Matrix = a
        if self.turns:
            xx, xy, yy, x, y = a[0][0], a[0][1], a[1][1], a[0][2], a[1][2]
            if not (is_zero(xx) and is_zero(xy) and is_zero(yy)):
                cs, ss, twice, double = self._double
                t = sub(xx, yy)
                m = add(mul(ss, t), mul(twice, xy))
                xx, yy, xy = sub(xx, m), add(yy, m), add(mul(cs, t), mul(double, xy))
            x, y = sub(mul(self.cosine, x), mul(self.sine, y)), add(mul(self.sine, x), mul(self.cosine, y))
            rows = [[xx, xy, x], [xy, yy, y], [x, y, a[2][2]]]
        return symmetric(product(product(self.rotation, rows), transposed(self.rotation)))

    def up_general(self, a: Matrix) -> list[list[Entry]]:
        """Return R a R' of any matrix; the antisymmetric part of its 2 x 2 block does not turn."""
        rows: Matrix = a
        if self.turns:
            cosine, sine = self.cosine, self.sine
            xx, xy, yx, yy = a[0][0], a[0][1], a[1][0], a[1][1]
            if not all(is_zero(entry) for entry in (xx, xy, yx, yy)):
                cs, ss, _, _ = self._double
                t, e = sub(xx, yy), add(xy, yx)
                m, change = add(mul(ss, t), mul(cs, e)), sub(mul(cs, t), mul(ss, e))
                xx, yy, xy, yx = sub(xx, m), add(yy, m), add(xy, change), add(yx, change)
            x, y, u, v = a[0][2], a[1][2], a[2][0], a[2][1]
            x, y = sub(mul(cosine, x), mul(sine, y)), add(mul(sine, x), mul(cosine, y))
            u, v = sub(mul(cosine, u), mul(sine, v)), add(mul(sine, u), mul(cosine, v))
            rows = [[xx, xy, x], [yx, yy, y], [u, v, a[2][2]]]
        return product(product(self.rotation, rows), transposed(self.rotation))

    @cached_property
    def _double(self) -> tuple[Entry, Entry, Entry, Entry]:
        cs, ss = mul(self.cosine, self.sine), mul(self.sine, self.sine)
        return cs, ss, mul(2.0, cs), sub(1.0, mul(2.0, ss))


@dataclass(frozen=True, eq=False)
class Motions:
    """The motions of all links; a run of parallel axes turns once, by the sum of its angles.

    The frames of all but the last link of a run keep the orientation of the frame before the run, so that only
    their origins and inertias move.
    """

    motions: tuple[JointMotion, ...]
    turned: tuple[JointMotion | None, ...]  # by which the inertia of a link that keeps its orientation turns

    @staticmethod
    def of(tree: Tree, q: Sequence[ca.SX]) -> Motions:
        """Return the motions of a tree at coordinates q (n,).

        Args:
            tree: in compact frames, for short graphs.
            q: scalar symbols.
        """
        n = len(tree.joints)
        fixed, offset = zip(*(_split(joint.rotation) for joint in tree.joints), strict=True) if n else ((), ())
        motions: list[JointMotion] = [JointMotion(identity(), [0.0] * 3)] * n
        turned: list[JointMotion | None] = [None] * n
        runs = _runs(tree, fixed)
        for i, joint in enumerate(tree.joints):
            if not joint.revolute:
                origin = plus(joint.origin, scaled(q[i], [row[2] for row in joint.rotation]))
                motions[i] = JointMotion(joint.rotation, origin)
            elif i not in runs:
                motions[i] = JointMotion(fixed[i], joint.origin, *shifted(q[i], offset[i]))
        for run in {id(run): run for run in runs.values()}.values():
            angle, total, before = ca.SX(0), 0.0, JointMotion(identity(), [0.0] * 3)
            for position, i in enumerate(run):
                angle, total = angle + q[i], total + offset[i]
                here = JointMotion(identity(), [0.0] * 3, *shifted(angle, total))
                origin = list(tree.joints[i].origin) if position == 0 else before.turned(tree.joints[i].origin)
                rotation = fixed[i] if position == 0 else identity()
                if position < len(run) - 1:
                    motions[i], turned[i] = JointMotion(rotation, origin), here
                else:
                    motions[i] = JointMotion(rotation, origin, here.cosine, here.sine)
                before = here
        return Motions(tuple(motions), tuple(turned))


def shifted(q: ca.SX, angle: float) -> tuple[ca.SX, ca.SX]:
    """Return cosine and sine of q + angle; a multiple of pi/2 costs no addition."""
    c, s = cosine_sine(angle)
    if {abs(c), abs(s)} == {0.0, 1.0}:
        cosine, sine = ca.cos(q), ca.sin(q)
        if s == 0.0:
            return (cosine, sine) if c > 0 else (-cosine, -sine)
        return (-sine, cosine) if s > 0 else (sine, -cosine)
    return ca.cos(q + angle), ca.sin(q + angle)


def _split(rotation: Matrix) -> tuple[Matrix, float]:
    """Return E = Rx(alpha) Rz(angle) as Rx(alpha) and the angle; E itself and 0 where it has another form."""
    e = numeric(rotation)
    if abs(e[0, 2]) > FLAT:
        return rotation, 0.0
    c, s = e[2, 2], -e[1, 2]
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    turn = tilt.T @ e
    angle = float(np.arctan2(turn[1, 0], turn[0, 0]))
    quarter = np.pi / 2 * round(angle / (np.pi / 2))
    return snapped(tilt), quarter if abs(angle - quarter) < 1e-12 else angle


def _runs(tree: Tree, fixed: Sequence[Matrix]) -> dict[int, list[int]]:
    """Return for every joint in a run of two or more parallel revolute axes without branches that run."""
    runs: dict[int, list[int]] = {}
    for i, joint in enumerate(tree.joints):
        p = joint.parent
        if p < 0 or not joint.revolute or not tree.joints[p].revolute or tree.children(p) != [i]:
            continue
        if np.allclose(numeric(fixed[i]), np.eye(3), rtol=0.0, atol=FLAT):
            run = runs.setdefault(p, [p])
            run.append(i)
            runs[i] = run
    return runs
