"""Orientation of the tool at the start, at the end or at a via point of a task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.rigid_bodies.orientations import axis_angle, rotation_matrix
from models.rigid_bodies.tool_poses import orientation_error
from models.scenes.toml_document import Table
from ocp.problem.constraints import Constraint
from ocp.system import Label, System

KEY = "orientation"
ANGLES = (Label("roll", "rad"), Label("pitch", "rad"), Label("yaw", "rad"))
SAME = 1e-9  # angle between two orientations that is rounding [rad]


@dataclass(frozen=True)
class Orientation:
    """The axes of the tool: turned by roll about e_1, then pitch about e_2, then yaw about e_3 of the base [rad]."""

    angles: tuple[float, ...]  # roll, pitch, yaw [rad]
    signal: str = KEY

    def at(self, where: Callable[..., Constraint], system: System) -> Constraint:
        """Return the constraint at the start or at the end, as `where` is start or end."""
        return where(orientation_error(system, self.angles), 0.0, name="orientation of the tool")

    def holds_in(self, point: tuple[object, ...]) -> bool:
        """Return whether this orientation is also that of a point."""
        own = rotation_matrix(self.angles)
        others = [rotation_matrix(one.angles) for one in point if isinstance(one, Orientation)]
        return any(float(np.linalg.norm(axis_angle((own.T @ other)[None]))) < SAME for other in others)

    def known_to(self, system: System) -> bool:
        """Return whether a system has an orientation of the tool."""
        return "tool_axes" in system.signals

    def words(self, system: System) -> list[str]:
        """Return the orientation in words, for the card of a system."""
        return [f"{label.name} = {angle:.6g} rad" for label, angle in zip(ANGLES, self.angles, strict=True)]


def read_orientation(table: Table, system: System) -> Orientation:
    """Return the entry orientation = [roll, pitch, yaw] of a point, in degrees with `_deg` behind the key.

    Args:
        table: the point.
        system: of the scene.

    Raises:
        SceneError: no three finite numbers, or a machine whose tool has no axes.
    """
    if "tool_axes" not in system.signals:
        spelled = KEY if KEY in table.entries else f"{KEY}_deg"
        raise table.error(spelled, 'is for arms of links, such as { robot = "ur5" }; this machine has a tool point')
    return Orientation(table.column(KEY, ANGLES))
