"""Capsules of the links of robots of makers, from published numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.rigid_bodies.joint import Capsule

Point = tuple[float, float, float]
Shapes = tuple[tuple[Capsule, ...], ...]  # of every link


def universal_shapes(lengths: Sequence[float], radii: Sequence[float]) -> Shapes:
    """Return the capsules of a Universal Robots arm, along the lines between its joints.

    Args:
        lengths: shoulder height, offsets of upper arm and elbow, lengths of upper arm, forearm, wrists and flange [m].
        radii: of shoulder and elbow, upper arm, forearm, first wrists, last wrist [m].

    Source: radii from the package ur_description of ROS-Industrial, config/ur5/physical_parameters.yaml ("manually
        measured" there) and config/ur10/physical_parameters.yaml.
    """
    _, across, back, upper, fore, wrist1, wrist2, flange = lengths
    joint, arm, forearm, wrist, last = radii
    zero = (0.0, 0.0, 0.0)
    elbow = (0.0, 0.0, upper)
    # The last capsule ends with its cap at the flange.
    end = max(flange - last, 0.0)
    return (
        (Capsule(zero, (0.0, across, 0.0), joint),),
        (Capsule(zero, elbow, arm), Capsule(elbow, (0.0, back, upper), joint)),
        (Capsule(zero, (0.0, 0.0, fore), forearm),),
        (Capsule(zero, (0.0, wrist1, 0.0), wrist),),
        (Capsule(zero, (0.0, 0.0, wrist2), wrist),),
        (Capsule(zero, (0.0, end, 0.0), last),),
    )


def panda_shapes() -> Shapes:
    """Return the capsules that the Franka Emika Panda checks itself with, those of the hand with the last link.

    Source: the package franka_description of Franka Emika, files franka_arm.xacro and franka_hand.xacro
        (self_collision_geometries, safety distance 0).
    """
    eighth, x, y, z = np.pi / 4, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return (
        (_around((0.0, 0.0, -0.1915), z, 0.06, 0.283),),
        (_around((0.0, 0.0, 0.0), z, 0.06, 0.12),),
        (_around((0.0, 0.0, -0.145), z, 0.06, 0.15),),
        (_around((0.0, 0.0, 0.0), z, 0.06, 0.12),),
        (_around((0.0, 0.0, -0.26), z, 0.06, 0.10), _around((0.0, 0.08, -0.13), z, 0.025, 0.14)),
        (_around((0.0, 0.0, -0.03), z, 0.05, 0.08),),
        (
            _around((0.0, 0.0, 0.01), z, 0.04, 0.14),
            _around((0.06, 0.0, 0.082), x, 0.03, 0.01, eighth),
            _around((0.0, 0.0, 0.107 + 0.04), y, 0.04, 0.10, -eighth),
            _around((0.0, 0.0, 0.107 + 0.10), y, 0.02, 0.10, -eighth),
        ),
    )


def _around(centre: Point, direction: Point, radius: float, length: float, turn: float = 0.0) -> Capsule:
    """Return a capsule about a centre, in axes turned about z of the link by an angle [rad]."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    middle, half = rotation @ np.array(centre), rotation @ np.array(direction) * length / 2.0
    return Capsule(tuple(middle - half), tuple(middle + half), radius)
