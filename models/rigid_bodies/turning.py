"""Products of angular velocity and acceleration that the recursion of Newton and Euler uses repeatedly."""

from __future__ import annotations

from models.rigid_bodies.scalars import Entry, Matrix, Vector, add, apply, mul, neg, sub


class Turning:
    """Angular velocity w and acceleration dw of a link with their six products, formed once."""

    def __init__(self, w: Vector, dw: Vector) -> None:
        self.w, self.dw = w, dw
        self.squares = tuple(mul(x, x) for x in w)
        xx, yy, zz = self.squares
        self.xy, self.xz, self.yz = mul(w[0], w[1]), mul(w[0], w[2]), mul(w[1], w[2])
        self.matrix: Matrix = [
            [neg(add(yy, zz)), sub(self.xy, dw[2]), add(self.xz, dw[1])],
            [add(self.xy, dw[2]), neg(add(xx, zz)), sub(self.yz, dw[0])],
            [sub(self.xz, dw[1]), add(self.yz, dw[0]), neg(add(xx, yy))],
        ]

    def of(self, p: Vector) -> list[Entry]:
        """Return dw x p + w x (w x p)."""
        return apply(self.matrix, p)

    def turned(self, j: Matrix) -> list[Entry]:
        """Return J dw + w x J w."""
        (xx, yy, zz), m, dw = self.squares, self.matrix, self.dw
        a, b, c, d, e, f = j[0][0], j[1][1], j[2][2], j[0][1], j[0][2], j[1][2]
        return [
            add(mul(a, dw[0]), mul(sub(c, b), self.yz), mul(neg(d), m[2][0]), mul(e, m[1][0]), mul(f, sub(yy, zz))),
            add(mul(b, dw[1]), mul(sub(a, c), self.xz), mul(neg(f), m[0][1]), mul(d, m[2][1]), mul(e, sub(zz, xx))),
            add(mul(c, dw[2]), mul(sub(b, a), self.xy), mul(neg(e), m[1][2]), mul(f, m[0][2]), mul(d, sub(xx, yy))),
        ]
