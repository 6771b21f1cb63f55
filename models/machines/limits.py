"""Limits of the joints of a machine: position, speed, drive force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Ends = Sequence[float | None]


@dataclass(frozen=True)
class JointLimits:
    """What a data sheet or a robot file states about every joint, None where it states nothing.

    Args:
        lower, upper: (n,) ends of the coordinates [rad or m].
        speed: (n,) largest |dq/dt| [rad/s or m/s].
        effort: (n,) largest drive force [N m or N].
    """

    lower: Ends
    upper: Ends
    speed: Ends
    effort: Ends
