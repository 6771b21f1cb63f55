"""Motors in TOML files: the table [motors] of a scene, or a catalogue of one's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.scenes.scene import Scene
from models.scenes.toml_document import Table
from models.torques.gear_sizing import Motor
from models.torques.shaft import RPM

KEYS = ("name", "inertia", "rated", "peak", "speed", "speed_rpm", "constant", "ratio", "efficiency")


@dataclass(frozen=True)
class GearedMotor:
    """A motor with its gear."""

    motor: Motor
    ratio: float | None  # motor speed over joint speed; None if it is to be chosen
    efficiency: float  # of the gear


def read_motors(document: Table) -> Mapping[str, GearedMotor]:
    """Return the motors of the table [motors] by their keys; an empty mapping if there is none.

    [motors.<key>] has inertia [kg m^2] and rated [N m], and maybe peak [N m], speed [rad/s] or speed_rpm, constant
    [N m/A], name, and for the gear ratio and efficiency.

    Args:
        document: made by `read_document`.

    Raises:
        SceneError: a wrong name or number; the message names file, line and key.
    """
    table = document.table("motors")
    return {key: _motor(key, table.table(key)) for key in table.entries}


def motors_of_drives(document: Table, scene: Scene) -> dict[int, GearedMotor]:
    """Return the motors of a scene by the indices of their drives; keys are the names of the coordinates.

    Raises:
        SceneError: a key that is no coordinate, or a wrong number.
    """
    names = [c.name for c in scene.machine.coordinates]
    table = document.table("motors")
    table.only(names)
    return {names.index(key): motor for key, motor in read_motors(document).items()}


def _motor(key: str, table: Table) -> GearedMotor:
    table.only(KEYS)
    for name in ("inertia", "rated"):
        table.require(name)
    if "speed" in table.entries and "speed_rpm" in table.entries:
        raise table.error("speed_rpm", "stands beside 'speed'; keep one of them")
    named = table.entries.get("name", key)
    if not isinstance(named, str):
        raise table.error("name", "expected a text")
    numbers = {
        entry: table.finite(entry, table.entries[entry], unit)
        for entry, unit in (
            ("inertia", "kg m^2"), ("rated", "N m"), ("peak", "N m"), ("speed", "rad/s"), ("speed_rpm", "1/min"),
            ("constant", "N m/A"), ("ratio", ""), ("efficiency", ""),
        )
        if entry in table.entries
    }  # fmt: skip
    for entry, value in numbers.items():
        if value <= 0.0 or (entry == "efficiency" and value > 1.0):
            wanted = "a number in (0, 1]" if entry == "efficiency" else "a number > 0"
            raise table.error(entry, f"got {value:g}, expected {wanted}")
    speed = numbers.get("speed", numbers["speed_rpm"] / RPM if "speed_rpm" in numbers else np.inf)
    try:
        motor = Motor(
            named, numbers["inertia"], numbers["rated"], numbers.get("peak", np.inf), speed, numbers.get("constant")
        )
    except ValueError as error:
        raise table.error("", str(error)) from None
    return GearedMotor(motor, numbers.get("ratio"), numbers.get("efficiency", 1.0))
