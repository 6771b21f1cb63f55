"""The part of a scene file that keeps links clear: their capsules, and what they keep away from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.machines.manipulator import Manipulator
from models.rigid_bodies.clearances import without_capsules
from models.rigid_bodies.collisions import (
    COVER,
    MARGIN,
    THINNEST,
    body_capsule,
    self_pairs,
    skeleton_shapes,
    with_shapes,
)
from models.rigid_bodies.joint import Capsule
from models.scenes.interval_entry import read_interval
from models.scenes.link_clearance import LinkClearance
from models.scenes.robot_entry import machine_limits
from models.scenes.task import Obstacle
from models.scenes.toml_document import Table, describe
from ocp.system import Label

TABLE = "collisions"
OF_SHAPES = ("radius", "capsules")
OF_CLEARANCE = ("links", "clearance", "floor", "self", "self_clearance", "margin", "cover")


def with_links(document: Table, machine: Manipulator) -> Manipulator:
    """Return the machine with the capsules of the table [collisions] of a document.

    Args:
        document: of a scene.
        machine: of the same document.

    Raises:
        SceneError: a wrong key, number or body; the message names file, line and key.
    """
    table = document.table(TABLE)
    table.only((*OF_CLEARANCE, *OF_SHAPES))
    if table.has("radius"):
        radius = _positive(table, "radius")
        if machine.shapes and not without_capsules(machine):
            raise table.error("radius", f"{machine.name} has capsules of its own; leave it out")
        within = _travel(document, table, machine)
        try:
            machine = with_shapes(machine, skeleton_shapes(machine, radius, within))
        except ValueError as error:
            raise table.error("radius", str(error)) from None
    for inner in table.tables("capsules"):
        inner.only(["body", "start", "end", "radius"])
        inner.require("body", "start", "end", "radius")
        body = inner.text("body", [body.name for body in machine.bodies])
        capsule = Capsule(_point(inner, "start"), _point(inner, "end"), _positive(inner, "radius"))
        machine = with_shapes(machine, [body_capsule(machine, body, capsule)])
    return machine


def entries_of_shapes(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a document on which the capsules of its machine depend."""
    table = entries.get(TABLE)
    if not isinstance(table, Mapping):
        return {} if table is None else {TABLE: table}
    shapes = {name: table[name] for name in OF_SHAPES if name in table}
    limits = entries.get("limits")
    if "radius" not in shapes or not isinstance(limits, Mapping):
        return {TABLE: shapes} if shapes else {}
    return {TABLE: shapes, "limits": {name: limits[name] for name in ("machine", "q", "q_deg") if name in limits}}


def read_clearance(document: Table, machine: Manipulator, obstacles: Sequence[Obstacle]) -> LinkClearance | None:
    """Return what the links of a document keep clear of; None without a table [collisions].

    Args:
        document: of a scene.
        machine: of the scene, with its capsules.
        obstacles: of the task; those that are for links.

    Raises:
        SceneError: a wrong key, number or pair, or a machine without capsules.
    """
    if TABLE not in document.entries:
        return None
    table = document.table(TABLE)
    if not machine.shapes:
        raise table.error("", f"{machine.name} has no capsules; give a radius of its lines, or [[{TABLE}.capsules]]")
    distance, apart = (_distance(table, name) for name in ("clearance", "self_clearance"))
    margin = _positive(table, "margin") if table.has("margin") else MARGIN
    cover = table.number("cover", "m", COVER)
    if cover < THINNEST:
        raise table.error("cover", f"got {cover:g} m, expected a distance >= {THINNEST:g}")
    floor = table.number("floor", "m") if table.has("floor") else None
    regions = {one.name: one.region for one in obstacles if one.links}
    return LinkClearance(machine, regions, _pairs(table, machine), floor, distance, apart, margin, cover)


def obstacles_for_links(document: Table) -> bool:
    """Return whether obstacles without a signal of their own are for all links."""
    table = document.table(TABLE)
    return _truth(table, "links", TABLE in document.entries)


def check_ends(table: Table, clearance: LinkClearance, points: Mapping[str, Sequence[float]]) -> None:
    """Raise SceneError if the links touch something at a position that a task fixes.

    Args:
        table: the task.
        clearance: of its links.
        points: key of the task -> position (n,).
    """
    for name, q in points.items():
        reason = clearance.fault(np.array(q))
        if reason:
            raise table.error(name if name in table.entries or "[" in name else f"{name}_deg", reason)


def _pairs(table: Table, machine: Manipulator) -> tuple[tuple[str, str], ...]:
    value = table.entries.get("self", False)
    if isinstance(value, bool):
        return self_pairs(machine) if value else ()
    expected = 'expected true, false or pairs of bodies, [ ["a", "b"], ... ]'
    if not isinstance(value, list):
        raise table.error("self", f"got {describe(value)}, {expected}")
    bodies = list(dict.fromkeys(shape.body for shape in machine.shapes))
    made = []
    for pair in value:
        if not (isinstance(pair, list) and len(pair) == 2):
            raise table.error("self", f"got {describe(pair)}, {expected}")
        for body in pair:
            Table(table.file, table.lines, table.key, {"self": body}).text("self", bodies)
        if pair[0] == pair[1]:
            raise table.error("self", f"{pair[0]} stands beside itself; give two bodies")
        made.append((pair[0], pair[1]))
    return tuple(dict.fromkeys(made))


def _travel(document: Table, table: Table, machine: Manipulator) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the limits of the coordinates in a document, which links that slide are how long at most."""
    limits, own = machine_limits(document.table("limits"), machine)
    labels = tuple(Label(c.name, c.unit) for c in machine.coordinates)
    given = [read_interval(limits, "q", labels, both_sides=True)] if limits.has("q") else []
    known = [*given, *(one for one in own if one.signal == "q")]
    lower, upper = (known[0].lower, known[0].upper) if known else ((-np.inf,) * len(labels), (np.inf,) * len(labels))
    for label, low, high in zip(labels, lower, upper, strict=True):
        if label.unit == "m" and not np.isfinite(high - low):
            raise table.error("radius", f"{label.name} has no limits, and links are as long as it lets them be; give "
                              f"lower and upper limits of {label.name} [m] in limits.q")  # fmt: skip
    return lower, upper


def _distance(table: Table, name: str) -> float:
    value = table.number(name, "m", 0.0)
    if value < 0.0:
        raise table.error(name, f"got {value:g} m, expected a distance >= 0")
    return value


def _positive(table: Table, name: str) -> float:
    value = table.number(name, "m")
    if not value > 0.0:
        raise table.error(name, f"got {value:g} m, expected a length > 0")
    return value


def _point(table: Table, name: str) -> tuple[float, float, float]:
    value = table.entries[name]
    if not isinstance(value, list) or len(value) != 3:
        raise table.error(name, "expected three numbers [x, y, z] in m, from the mass centre of the body, in its axes")
    x, y, z = (table.finite(name, one, "m") for one in value)
    return x, y, z


def _truth(table: Table, name: str, default: bool) -> bool:
    value = table.entries.get(name, default)
    if not isinstance(value, bool):
        raise table.error(name, f"got {describe(value)}, expected true or false")
    return value
