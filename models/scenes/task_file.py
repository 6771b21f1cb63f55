"""The part of a scene file that is the task."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca

from models.mechanics.terms import snake
from models.rigid_bodies.clearances import FLOOR
from models.scenes.collision_table import check_ends, obstacles_for_links, read_clearance
from models.scenes.interval_entry import parts_of, read_interval
from models.scenes.robot_entry import machine_limits
from models.scenes.scene import Scene
from models.scenes.scene_file import KEYS, read_scene
from models.scenes.task import Interval, Obstacle, Point, Task, without_standing_legs
from models.scenes.toml_document import SceneError, Table, describe, is_angle, parse, read_document, spellings, unknown
from models.scenes.tool_orientation import KEY, read_orientation
from ocp.problem import regions
from ocp.problem.problem import Fixed, Free
from ocp.problem.regions import inside, outside
from ocp.system import Label, System

Weights = Mapping[str, tuple[float, ...]]
REGIONS: dict[str, Callable[..., Any]] = {
    snake(name): thing
    for name, thing in vars(regions).items()
    if isinstance(thing, type) and dataclasses.is_dataclass(thing) and hasattr(thing, "within")
}
TASK_KEYS = ("limits", "collisions", "task")
REGION_SIDES = {"outside": outside, "inside": inside}


def load(path: str | Path) -> tuple[Scene, Task]:
    """Read a scene file: the scene and the task.

    Args:
        path: of a TOML file.

    Raises:
        SceneError: the file cannot be used; one sentence with file, line and key.
    """
    return of_document(read_document(path))


def of_text(text: str, file: str) -> tuple[Scene, Task]:
    """Return the scene and the task of a text, which messages call `file`."""
    return of_document(parse(text, file))


def of_document(document: Table) -> tuple[Scene, Task]:
    """Return the scene and the task of a document; of a study, for the numbers that stand in the file."""
    document.only([*KEYS, *TASK_KEYS, "study", "motors"])
    scene = read_scene(document)
    return scene, read_task(document, scene)


def read_task(document: Table, scene: Scene) -> Task:
    """Return the task of a document.

    Args:
        document: made by `models.document.read_document`.
        scene: of the same document.

    Raises:
        SceneError: a wrong name, number or combination; the message names file, line and key.
    """
    system = scene.system
    results = read_limits(document, scene)
    document.require("task")
    table = document.table("task")
    table.only(["from", "from_deg", "to", "to_deg", "via", "obstacles", "minimise", "horizon", "elements"])
    for name in ("from", "to"):
        if not table.has(name):
            raise table.error("", f"the key {name!r} is missing")
    points = table.entries.get("via", [])
    if not isinstance(points, list):
        raise table.error("via", "expected a list of points, via = [ [...], ... ]")
    given = tuple(
        _pose(Table(table.file, table.lines, table.key, {f"via[{k}]": point}), f"via[{k}]", scene)
        for k, point in enumerate(points, 1)
    )
    begin, finish = _pose(table, "from", scene), _pose(table, "to", scene)
    still = Interval("v", *(((0.0,) * system["v"].numel(),) * 2)) if "v" in system.signals else None
    edges = [(*point, still) if still is not None and still.signal not in {one.signal for one in point} else point
             for point in (begin, finish)]  # fmt: skip
    via, horizons = without_standing_legs([edges[0], *given, edges[1]], _horizons(table, len(given) + 1))
    time, squares, integral = _cost(table, system)
    obstacles = _obstacles(table, system, obstacles_for_links(document))
    clearance = read_clearance(document, scene.machine, obstacles)
    task = Task(
        begin,
        via,
        finish,
        tuple(results),
        obstacles,
        horizons,
        _elements(table),
        time,
        squares,
        integral,
        clearance,
    )
    try:
        task.problem(system)
    except (ValueError, TypeError) as error:
        raise table.error("", str(error)) from None
    if clearance is not None:
        fixed = {"from": begin, **{f"via[{k}]": point for k, point in enumerate(given, 1)}, "to": finish}
        check_ends(table, clearance, {
            name: one.lower for name, point in fixed.items() for one in point
            if isinstance(one, Interval) and one.signal == "q" and one.lower == one.upper
        })  # fmt: skip
    return task


def read_limits(document: Table, scene: Scene) -> list[Interval]:
    """Return the limits of the table [limits] of a document, and those of the machine that it does not replace.

    Args:
        document: made by `read_document`.
        scene: of the same document.

    Raises:
        SceneError: a wrong name or number.
    """
    system = scene.system
    limits, results = machine_limits(document.table("limits"), scene.machine)
    named = _signals(limits, system)
    results = [one for one in results if one.signal not in named]
    return results + [read_interval(limits, name, parts_of(system, name), both_sides=True) for name in named]


def _signals(table: Table, system: System, others: tuple[str, ...] = ()) -> list[str]:
    names, result = list(system.signals), []
    angles = [f"{name}_deg" for name in names if any(is_angle(part.unit) for part in parts_of(system, name))]
    for key in table.entries:
        if key in others:
            continue
        if key not in names and key not in angles:
            raise table.error(key, unknown("signal", key, names))
        result.append(key if key in names else key.removesuffix("_deg"))
    return list(dict.fromkeys(result))


def _pose(table: Table, name: str, scene: Scene) -> Point:
    """Return what holds at the start, at the end or at a via point: a position, or signals by name."""
    system, value = scene.system, table.entries.get(name)
    parts = parts_of(system, "q")
    if isinstance(value, dict) and not any(key in spellings(parts) for key in value):
        inner = table.inner(name, value)
        if not value:
            raise inner.error("", f"is empty; expected {', '.join(map(str, parts))}, or signals by name")
        names = _signals(inner, system, (KEY, f"{KEY}_deg"))
        point = [read_interval(inner, signal, parts_of(system, signal), both_sides=False) for signal in names]
        return (*point, *((read_orientation(inner, system),) if inner.has(KEY) else ()))
    values = table.column(name, parts)
    return (Interval("q", values, values),)


def _cost(table: Table, system: System) -> tuple[float, Weights, Weights]:
    value = table.entries.get("minimise", "time")
    if isinstance(value, str):
        table.text("minimise", ["time"], "time")
        return 1.0, {}, {}
    inner = table.table("minimise")
    inner.only(["time", "squares", "integral"])
    if not inner.entries:
        raise inner.error("", "is empty; expected time, squares or integral")
    results = {}
    for kind in ("squares", "integral"):
        weights = inner.table(kind)
        for name in weights.entries:
            if name not in system.signals:
                raise weights.error(name, unknown("signal", name, list(system.signals)))
        results[kind] = {
            name: weights.column(name, [Label(part.name) for part in parts_of(system, name)], 0.0)
            for name in weights.entries
        }
    return inner.number("time", "", 0.0), results["squares"], results["integral"]


def _horizons(table: Table, legs: int) -> tuple[Free | Fixed, ...]:
    value = table.entries.get("horizon", {})
    if isinstance(value, list):
        if len(value) != legs:
            raise table.error("horizon", f"got {len(value)} horizons, expected {legs}, one for each leg")
        named = {f"horizon[{k}]": one for k, one in enumerate(value, 1)}
        return tuple(_horizon(Table(table.file, table.lines, table.key, named), name) for name in named)
    if legs > 1 and (not isinstance(value, dict) or set(value) - {"guess"}):
        raise table.error("horizon", f"the motion has {legs} legs; list their horizons, [ {{ guess = ... }}, ... ]")
    whole = _horizon(table, "horizon")
    return (whole,) if legs == 1 else (Free(guess=whole.guess / legs),) * legs if isinstance(whole, Free) else ()


def _horizon(table: Table, name: str) -> Free | Fixed:
    value = table.entries.get(name, {})
    if not isinstance(value, dict):
        seconds = table.finite(name, value, "s")
        if seconds <= 0.0:
            raise table.error(name, f"got {seconds:g} s, expected a duration > 0")
        return Fixed(seconds)
    inner = table.inner(name, value)
    inner.only(["guess", "lower", "upper"])
    try:
        return Free(**{key: inner.number(key, "s") for key in value})
    except SceneError:
        raise
    except ValueError as error:
        raise inner.error("", str(error).removeprefix("Free: ")) from None


def _elements(table: Table) -> int:
    value = table.entries.get("elements", 50)
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise table.error("elements", f"got {value!r}, expected a whole number >= 1")
    return value


def _obstacles(table: Table, system: System, links: bool) -> tuple[Obstacle, ...]:
    made: list[Obstacle] = []
    for inner in table.tables("obstacles"):
        one = _obstacle(inner, system, links)
        one = one if one.name else replace(one, name=f"{type(one.region).__name__}_{len(made) + 1}")
        if one.name in (FLOOR, *(other.name for other in made)):
            raise inner.error("name", f"there is another {one.name!r}; each obstacle has a name of its own")
        made.append(one)
    return tuple(made)


def _obstacle(table: Table, system: System, links: bool) -> Obstacle:
    shape = REGIONS[table.text("shape", REGIONS)]
    given = dataclasses.fields(shape)  # type: ignore[arg-type]
    names = [field.name for field in given]
    # The key "point" names the signal, unless the shape has a point of its own, as a half space has.
    spelled = "signal" if "signal" in table.entries or "point" in names else "point"
    table.only(dict.fromkeys(["shape", "keep", "signal", "point", *names, "name"]))
    values: dict[str, object] = {}
    for field in given:
        if field.name in table.entries:
            value = table.entries[field.name]
            several = field.type in ("Vector",)
            if several and (not isinstance(value, list) or len(value) != 3):
                raise table.error(field.name, "expected three numbers [x, y, z]")
            values[field.name] = (
                [table.finite(field.name, one, "m") for one in value] if isinstance(value, list)
                else table.finite(field.name, value, "m")
            )  # fmt: skip
        elif field.default is dataclasses.MISSING:
            raise table.error("", f"the key {field.name!r} is missing")
    points = [name for name, signal in system.signals.items() if _is_position(system, name, signal)]
    if spelled == "signal" and "point" in table.entries and "point" not in names:
        raise table.error("point", "stands beside 'signal'; keep one of them")
    point = table.text(spelled, points, "tool")
    keep = REGION_SIDES[table.text("keep", REGION_SIDES, "outside")]
    try:
        region = shape(**values)
        keep(region, system[point])
    except (ValueError, TypeError) as error:
        raise table.error("", str(error)) from None
    name = table.entries.get("name", "")
    if not isinstance(name, str):
        raise table.error("name", f"got {describe(name)}, expected a text")
    return Obstacle(region, keep, point, name, links and keep is outside and spelled not in table.entries)


def _is_position(system: System, name: str, signal: ca.SX) -> bool:
    return signal.numel() == 3 and name != "q" and all(part.unit == "m" for part in system.label(name, 3))
