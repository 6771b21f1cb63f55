"""Names and units of the coordinates of a motion."""

from __future__ import annotations

from models.machines.manipulator import Manipulator
from ocp import checks
from ocp.system import Label


def labels_of(machine: Manipulator | None) -> tuple[Label, ...]:
    """Return names and units of the coordinates of a machine; an empty tuple without one."""
    checks.instance("machine", machine, Manipulator | None, "a Manipulator such as spherical(), or None")
    return () if machine is None else tuple(Label(c.name, c.unit) for c in machine.coordinates)


def numbered(n: int) -> tuple[Label, ...]:
    """Return the labels q1 .. qn, without units."""
    return tuple(Label(f"q{i + 1}") for i in range(n))


def check_labels(labels: object) -> None:
    """Raise TypeError unless labels are a tuple of Labels."""
    if not isinstance(labels, tuple | list) or not all(isinstance(label, Label) for label in labels):
        raise TypeError(f"labels: got {checks.shown(labels)}, expected a tuple of Labels")
