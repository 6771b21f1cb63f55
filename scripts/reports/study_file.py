"""Studies as files: a scene file with a table [study] that lists which of its numbers vary."""

from __future__ import annotations

import functools
import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from models import Scene
from models.machines.parameters import unit_of
from models.mechanics.terms import snake
from models.scenes import catalogue
from models.scenes.collision_table import entries_of_shapes
from models.scenes.scene_file import KEYS, read_scene
from models.scenes.task import Task
from models.scenes.task_file import TASK_KEYS, read_task
from models.scenes.toml_document import SceneError, Table, describe, read_document
from ocp import LatinHypercube, Problem, Product, Random, Sequence, Sobol, Study, Zip, radau, uniform
from ocp.studies.designs import Design
from reports.drive_measures import measures

LISTS: dict[str, Callable[..., Design]] = {snake(kind.__name__): kind for kind in (Product, Zip)}
SAMPLES: dict[str, Callable[..., Design]] = {snake(kind.__name__): kind for kind in (Random, LatinHypercube, Sobol)}
SPACINGS: dict[str, Callable[..., np.ndarray]] = {"linear": np.linspace, "log": np.geomspace}
STUDY = ("over", "design", "count", "seed", "polished", "neighbours", "checked", "slopes", "verified", "gentle",
         "starts")  # fmt: skip
TEXTS = ("machine", "form", "frame")


@dataclass(frozen=True)
class SceneProblem:
    """The problem of a scene file, a function of the numbers in it that vary.

    Args:
        content: of the file without the study, as JSON.
        symbols: names of the values that are parameters of the system.
        others: names of the values that are put into the file before it is read.
        keys: of all names, in dots.
    """

    content: str
    symbols: tuple[str, ...]
    others: tuple[str, ...]
    keys: tuple[tuple[str, str], ...]

    @property
    def __signature__(self) -> inspect.Signature:
        kind = inspect.Parameter.KEYWORD_ONLY
        return inspect.Signature([inspect.Parameter(_argument(name), kind) for name in self.others])

    def __call__(self, **values: Any) -> Problem | Sequence:
        """Return the problem for those values that are not parameters of the system."""
        scene, task = self.at(values)
        return task.problem(scene.system)

    def at(self, values: Mapping[str, Any]) -> tuple[Scene, Task]:
        """Return the scene and the task for values of `others`, by name or with underscores for dots."""
        keys, named = dict(self.keys), {_argument(name): name for name in self.others}
        changes = {keys[named[_argument(name)]]: value for name, value in values.items()}
        document = changed(Table("study", {}, "", json.loads(self.content)), changes)
        entries = {k: v for k, v in document.entries.items() if k in KEYS} | entries_of_shapes(document.entries)
        scene = _scene(json.dumps(entries), tuple(keys[name] for name in self.symbols))
        return scene, read_task(document, scene)


@functools.lru_cache(maxsize=64)
def _scene(content: str, symbols: tuple[str, ...]) -> Scene:
    """Return a scene; cases with the same one share its system, and with it the prepared NLP."""
    return read_scene(Table("study", {}, "", json.loads(content)), symbols)


def load(path: str | Path, store: str | Path | None) -> tuple[Study, Table]:
    """Read a study.

    Args:
        path: of a scene file with a table [study].
        store: of the study.

    Raises:
        SceneError: the file cannot be used; one sentence with file, line and key.
    """
    document = read_document(path)
    return of_document(document, store), document


def of_document(document: Table, store: str | Path | None) -> Study:
    """Return the study of a document.

    Raises:
        SceneError: a wrong name, number or combination; the message names file, line and key.
    """
    document.only([*KEYS, *TASK_KEYS, "study"])
    document.require("study")
    table = document.table("study")
    table.only(STUDY)
    bare = Table(document.file, document.lines, "",
                 {key: value for key, value in document.entries.items() if key != "study"})  # fmt: skip
    keys = {name: spelled(bare, name, table) for name in table.table("over").entries}
    design = _design(table, {name: shown(key) for name, key in keys.items()})
    keys = {shown(key): key for key in keys.values()}
    cases = design.cases()
    symbols = tuple(name for name in keys if _stays_symbol(bare, keys[name], cases[0][name]))
    others = tuple(name for name in keys if name not in symbols)
    for case in (cases[0], cases[-1]):  # errors of the file are found before anything is computed
        whole = changed(bare, {keys[name]: value for name, value in case.items()})
        task = read_task(whole, read_scene(whole, [keys[name] for name in symbols]))
    nominal = changed(bare, {keys[name]: cases[0][name] for name in symbols})
    return Study(
        SceneProblem(json.dumps(nominal.entries, sort_keys=True), symbols, others, tuple(keys.items())), design, store,
        scheme=radau(3), grid=uniform(task.elements), measure=measures, polished=_truth(table, "polished", False),
        neighbours=_truth(table, "neighbours", True), checked=table.number("checked", "", 0.05),
        slopes=_truth(table, "slopes", False), verified=_truth(table, "verified", False),
        gentle=_truth(table, "gentle", False), starts=table.entries.get("starts", 1),  # type: ignore[arg-type]  # Study checks it
    )  # fmt: skip


def shown(key: str) -> str:
    """Return what a key is called, as parameters are: m_3 for parameters.m_3, payload.mass for effects.payload.mass."""
    head, _, rest = key.partition(".")
    return rest if head in ("parameters", "effects") else key


def spelled(document: Table, name: str, table: Table) -> str:
    """Return the whole key that a name stands for: payload.mass is effects.payload.mass, m_3 is parameters.m_3.

    Raises:
        SceneError: the document has no such key, nor can it have.
    """
    head = name.partition(".")[0]
    if head in (*KEYS, *TASK_KEYS):
        return name
    if head in catalogue.effects():
        if head not in document.table("effects").entries:
            raise table.error("over", f"{name!r}: the effect {head!r} is off; add the table [effects.{head}]")
        return f"effects.{name}"
    machine = catalogue.machines()[document.text("machine", catalogue.machines())]
    if name in inspect.signature(machine).parameters:
        return f"parameters.{name}"
    raise table.error("over", f"{name!r} is no key of this scene; write parameters.NAME, EFFECT.FIELD, limits.SIGNAL, "
                      "task.KEY, with a component behind it (limits.tau.2), or limits.tau.factor")  # fmt: skip


def units(study: Study) -> dict[str, str]:
    """Return the units of the columns of a study of a scene, by name."""
    problem = study.function
    assert isinstance(problem, SceneProblem)
    case = study.cases[0]
    system = problem.at({name: case[name] for name in problem.others})[0].system
    results = {"duration": "s", "work": "J", "net": "J", "peak power": "W"}
    for signal in ("tau", "v"):
        for label in system.label(signal, system[signal].numel()):
            results |= {f"{kind} {label.name}": label.unit for kind in ("peak", "rms")}
    for name, key in problem.keys:
        head, *rest = key.split(".")
        if head == "parameters":
            results[name] = unit_of(rest[0])
        elif head == "effects":
            metadata = {field.name: field.metadata for field in fields(catalogue.effects()[rest[0]])}
            results[name] = metadata[rest[1].removesuffix("_deg")].get("unit", "") if len(rest) == 2 else ""
        elif head == "collisions":
            results[name] = "m"
        elif rest and rest[-1].isdigit():  # a component of a limit, or of the start or the goal
            signal = rest[0] if head == "limits" else "q"
            labels = system.label(signal, system[signal].numel()) if signal in system.signals else ()
            results[name] = labels[int(rest[-1]) - 1].unit if int(rest[-1]) <= len(labels) else ""
    return results


def changed(document: Table, changes: Mapping[str, Any]) -> Table:
    """Return a document with other values under some keys.

    The key of a component is the key of its list or table with the number (from 1) or the name behind it; `factor`
    behind a key multiplies all its numbers.

    Raises:
        SceneError: there is no such component.
    """
    entries = json.loads(json.dumps(document.entries))
    for key, value in changes.items():
        *way, last = key.split(".")
        target: Any = entries
        for part in way[:-1] if last == "factor" else way:
            target = _inside(document, target, part, key)
        if last == "factor":
            last = way[-1]
            value = _times(document, _entry(document, target, last, key), float(value), key)
        if isinstance(target, list):
            target[_number(document, target, last, key)] = value
        elif isinstance(target, dict):
            target[last] = list(value) if isinstance(value, tuple) else value
        else:
            raise document.error(key, f"has no component {last!r}, it is {describe(target)}")
    return Table(document.file, document.lines, document.key, entries)


def _inside(document: Table, target: Any, part: str, key: str) -> Any:
    if isinstance(target, dict):
        return target.setdefault(part, {})
    return _entry(document, target, part, key)


def _entry(document: Table, target: Any, part: str, key: str) -> Any:
    if isinstance(target, list):
        return target[_number(document, target, part, key)]
    if not isinstance(target, dict) or part not in target:
        raise document.error(key, f"there is no {part!r} to multiply")
    return target[part]


def _number(document: Table, target: list[Any], part: str, key: str) -> int:
    if not part.isdigit() or not 1 <= int(part) <= len(target):
        raise document.error(key, f"has no component {part!r}, expected a number from 1 to {len(target)}")
    return int(part) - 1


def _times(document: Table, value: Any, factor: float, key: str) -> Any:
    if isinstance(value, list):
        return [_times(document, one, factor, key) for one in value]
    if isinstance(value, dict):
        return {name: _times(document, one, factor, key) for name, one in value.items()}
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise document.error(key, f"got {describe(value)}, expected numbers to multiply")
    return factor * value


def _stays_symbol(document: Table, key: str, value: Any) -> bool:
    """Return whether a key is one number that the system can have as a parameter."""
    parts = key.split(".")
    if isinstance(value, str | bool | tuple) or (parts[0], len(parts)) not in (("parameters", 2), ("effects", 3)):
        return False
    try:
        scene = read_scene(changed(document, {key: value}), [key])
    except SceneError:
        return False  # a number that the shape of the graph depends on
    return shown(key) in scene.system.nominal


def _design(table: Table, called: Mapping[str, str]) -> Design:
    over = table.table("over")
    kind = table.text("design", [*LISTS, *SAMPLES], "product")
    if not over.entries:
        raise table.error("over", "is empty; expected [study.over] with a line for each key that varies")
    try:
        if kind in LISTS:
            for name in ("count", "seed"):
                if name in table.entries:
                    raise table.error(name, f"is for {', '.join(SAMPLES)}; the design is {kind!r}")
            return LISTS[kind]({called[name]: _values(over, name) for name in over.entries})
        count, seed = table.entries.get("count", 64), table.entries.get("seed", 0)
        return SAMPLES[kind]({called[name]: _range(over, name) for name in over.entries}, count, seed)
    except SceneError:
        raise
    except (ValueError, ImportError) as error:
        raise table.error("over", str(error)) from None


def _values(table: Table, name: str) -> list[Any]:
    value = table.entries[name]
    if isinstance(value, list):
        return value
    if not isinstance(value, dict):
        raise table.error(name, f"got {describe(value)}, expected a list, or {{ from = ..., to = ..., count = ... }}")
    inner = table.inner(name, value)
    inner.only(["from", "to", "count", "spacing"])
    inner.require("count")
    spacing, count = inner.text("spacing", SPACINGS, "linear"), value["count"]
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise inner.error("count", f"got {count!r}, expected a whole number >= 1")
    low, high = inner.number("from", ""), inner.number("to", "")
    if spacing == "log" and not low * high > 0.0:
        raise inner.error("spacing", f"log needs two numbers of one sign, got {low:g} and {high:g}")
    return list(SPACINGS[spacing](low, high, count).tolist())


def _range(table: Table, name: str) -> tuple[float, float]:
    value = table.entries[name]
    if isinstance(value, list) and len(value) == 2:
        return table.finite(name, value[0], ""), table.finite(name, value[1], "")
    if not isinstance(value, dict):
        raise table.error(name, f"got {describe(value)}, expected [lower, upper]")
    inner = table.inner(name, value)
    inner.only(["from", "to"])
    return inner.number("from", ""), inner.number("to", "")


def _truth(table: Table, name: str, default: bool) -> bool:
    value = table.entries.get(name, default)
    if not isinstance(value, bool):
        raise table.error(name, f"got {describe(value)}, expected true or false")
    return value


def _argument(name: str) -> str:
    return name.replace(".", "_")
