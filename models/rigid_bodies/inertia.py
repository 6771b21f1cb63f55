"""Inertia of a link in its frame: mass, first moment and tensor about the origin of the frame."""

from __future__ import annotations

from dataclasses import dataclass

from models.rigid_bodies.scalars import (
    Entry,
    Matrix,
    Vector,
    add,
    apply,
    cross,
    dot,
    mul,
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
    zeros,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class LinkInertia:
    """Mass m, first moment m c and tensor J about the origin of the frame of a link."""

    mass: Entry  # [kg]
    moment: Vector  # (3,) m c [kg m]
    tensor: Matrix  # (3, 3) about the origin [kg m^2]

    @staticmethod
    def of(mass: Entry, centre: Vector, tensor: Matrix) -> LinkInertia:
        """Return the inertia of a body with a mass centre [m] and a tensor about it [kg m^2], axes of the frame."""
        squared = dot(centre, centre)
        steiner = [
            [mul(mass, sub(squared if i == j else 0.0, mul(centre[i], centre[j]))) for j in range(3)] for i in range(3)
        ]
        return LinkInertia(mass, scaled(mass, centre), symmetric(total(tensor, steiner)))

    @staticmethod
    def zero() -> LinkInertia:
        """Return the inertia of nothing."""
        return LinkInertia(0.0, [0.0] * 3, zeros())

    def __add__(self, other: LinkInertia) -> LinkInertia:
        return LinkInertia(
            add(self.mass, other.mass),
            plus(self.moment, other.moment),
            symmetric(total(self.tensor, other.tensor)),
        )

    def moved(self, rotation: Matrix, origin: Vector) -> LinkInertia:
        """Return the inertia in a parent frame, parent = rotation child + origin."""
        moment = apply(rotation, self.moment)
        turned = product(product(rotation, self.tensor), transposed(rotation))
        first, arm = skew(moment), skew(origin)
        mixed = product(first, arm)
        tensor = total(turned, negative(mixed), negative(transposed(mixed)))
        tensor = total(tensor, negative(scaled_matrix(self.mass, product(arm, arm))))
        return LinkInertia(self.mass, plus(moment, scaled(self.mass, origin)), symmetric(tensor))

    def split(self, revolute: bool) -> tuple[LinkInertia, LinkInertia]:
        """Return the part that a joint about (along) z feels, and the rest, which the link before it may carry.

        About an axis z the mass, the first moment along z and a tensor diag(J_yy, J_yy, 0) do not change with the
        angle; along an axis only the mass and the first moment do change the inertia of the link before.

        Source: M. Gautier, W. Khalil, Direct calculation of minimum set of inertial parameters of serial robots, IEEE
            Trans. Robotics and Automation 6 (1990).
        """
        j = self.tensor
        if not revolute:
            return LinkInertia(self.mass, self.moment, zeros()), LinkInertia(0.0, [0.0] * 3, j)
        felt = symmetric([[sub(j[0][0], j[1][1]), j[0][1], j[0][2]], [0.0, 0.0, j[1][2]], [0.0, 0.0, j[2][2]]])
        carried: Matrix = [[j[1][1], 0.0, 0.0], [0.0, j[1][1], 0.0], [0.0, 0.0, 0.0]]
        rest = LinkInertia(self.mass, [0.0, 0.0, self.moment[2]], carried)
        return LinkInertia(0.0, [self.moment[0], self.moment[1], 0.0], felt), rest

    def momentum(self, turning: Vector, moving: Vector) -> tuple[list[Entry], list[Entry]]:
        """Return angular momentum about the origin and linear momentum at the velocities omega and v of the origin."""
        return (
            plus(apply(self.tensor, turning), cross(self.moment, moving)),
            plus(scaled(self.mass, moving), cross(turning, self.moment)),
        )
