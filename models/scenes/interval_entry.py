"""Entries of scene files that are values or limits of a signal, component by component."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.scenes.task import Interval
from models.scenes.toml_document import Table, is_angle
from ocp.system import Label, System

SIDES = ("lower", "upper", "lower_deg", "upper_deg")


def read_interval(table: Table, name: str, parts: Sequence[Label], both_sides: bool) -> Interval:
    """Return the interval of a signal in an entry: values, limits in both directions, or { lower = ..., upper = ... }.

    Args:
        table: with the entry.
        name: of the signal; the entry may have `_deg` behind it.
        parts: components of the signal.
        both_sides: whether plain numbers are limits in both directions, not values.

    Raises:
        SceneError: a wrong number, or lower > upper.
    """
    value = table.entries.get(name)
    if isinstance(value, dict) and any(key in SIDES for key in value):
        inner = table.inner(name, value)
        inner.only(SIDES if any(is_angle(part.unit) for part in parts) else SIDES[:2])
        lower = inner.column("lower", parts, -np.inf) if inner.has("lower") else (-np.inf,) * len(parts)
        upper = inner.column("upper", parts, np.inf) if inner.has("upper") else (np.inf,) * len(parts)
        for part, low, high in zip(parts, lower, upper, strict=True):
            if low > high:
                raise inner.error("", f"lower {low:g} is above upper {high:g} {part.unit} for {part.name}")
        return Interval(name, lower, upper)
    if not both_sides:
        values = table.column(name, parts)
        return Interval(name, values, values)
    sizes = table.column(name, parts, np.inf)
    for part, size in zip(parts, sizes, strict=True):
        if size < 0.0:
            spelled = name if name in table.entries else f"{name}_deg"
            raise table.error(spelled, f"got {size:g} {part.unit} for {part.name}, expected numbers >= 0, "
                              "or { lower = ..., upper = ... }")  # fmt: skip
    return Interval(name, tuple(-size for size in sizes), sizes)


def parts_of(system: System, name: str) -> tuple[Label, ...]:
    """Return the components of a signal; those of coordinates, velocities and forces by the coordinate's name."""
    labels, coordinates = system.label(name, system[name].numel()), system.label("q", system["q"].numel())
    same = len(labels) == len(coordinates) and name.split("_")[-1] in ("q", "v", "tau")
    return tuple(Label(c.name, part.unit) for c, part in zip(coordinates, labels, strict=True)) if same else labels
