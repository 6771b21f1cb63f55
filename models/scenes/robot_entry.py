"""Machines of scene files that come from elsewhere: robots with published data, URDF files, and their limits."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

from models.machines.manipulator import Manipulator
from models.rigid_bodies import from_urdf, robots
from models.scenes.task import Interval
from models.scenes.toml_document import Table, describe

ROBOT_KEYS, URDF_KEYS = ("robot",), ("urdf", "tip", "lock")


def shipped() -> dict[str, Callable[[], Manipulator]]:
    """Return the functions of `models.robots`, by name."""
    return {
        name: thing
        for name, thing in vars(robots).items()
        if inspect.isfunction(thing) and thing.__module__ == robots.__name__ and not name.startswith("_")
    }


def read_robot(document: Table) -> Manipulator:
    """Return the machine of an entry machine = { robot = "panda" } or { urdf = "ur5.urdf", tip = "tool0" }.

    The path of a URDF file is that from the folder of the scene file. Nothing of a file is executed.

    Args:
        document: with the entry.

    Raises:
        SceneError: a wrong key or name, or a file that cannot be read; the message names file, line and key.
    """
    table = document.table("machine")
    if document.has("parameters") and document.table("parameters").entries:
        raise document.error("parameters", "a robot has none; give effects instead, or a machine by its name")
    if table.has("robot"):
        table.only(ROBOT_KEYS)
        known = shipped()
        return known[table.text("robot", known)]()
    table.only((*URDF_KEYS, *ROBOT_KEYS))
    path, tip = table.entries.get("urdf"), table.entries.get("tip")
    if not isinstance(path, str):
        missing = "the key 'urdf' or 'robot' is missing"
        raise table.error("", missing if path is None else f"urdf: got {describe(path)}, expected a path")
    if tip is not None and not isinstance(tip, str):
        raise table.error("tip", f"got {describe(tip)}, expected the name of a link")
    locks = table.table("lock")
    lock = {name: locks.finite(name, value, "rad or m") for name, value in locks.entries.items()}
    try:
        return from_urdf(Path(document.file).parent / path, tip, lock)
    except (ValueError, TypeError) as error:
        raise table.error("urdf", str(error)) from None


def machine_limits(table: Table, machine: Manipulator) -> tuple[Table, list[Interval]]:
    """Return the table without the key `machine`, and the limits of the machine if it is true.

    Args:
        table: the limits of a scene file.
        machine: with limits of its own.

    Raises:
        SceneError: the key is neither true nor false, or the machine has no limits.
    """
    wanted = table.entries.get("machine", False)
    rest = Table(table.file, table.lines, table.key, {k: v for k, v in table.entries.items() if k != "machine"})
    if not isinstance(wanted, bool):
        raise table.error("machine", f"got {describe(wanted)}, expected true or false")
    if wanted and not machine.limits:
        raise table.error("machine", f"{machine.name} states no limits; give them by signal")
    return rest, [Interval(name, *ends) for name, ends in machine.limits.items()] if wanted else []
