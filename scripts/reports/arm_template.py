"""The commented scene file of any arm: a robot with published data, a URDF file, or a machine of one's own."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from models import Manipulator
from models.plots.machines import joint_axes
from models.plots.signals import skeleton
from models.rigid_bodies import from_urdf
from models.scenes import catalogue
from models.scenes.docstring_words import argument_units, argument_words
from models.scenes.robot_entry import shipped
from models.scenes.scene_template import TASKS, collision_lines, effect_lines, scene_text
from ocp.checks import Array
from reports.scene_toml import key_of

STEP = 0.5  # [rad or m] between start and goal of the task, at most a quarter of the range of a coordinate
UNKNOWN = 100.0  # [N m or N] a limit of a drive that no file states, to be replaced
SIGNALS = {"q": "positions", "v": "speeds", "tau": "drives"}


def template(name: str) -> str:
    """Return the commented scene file of a machine, a robot or a URDF file.

    Args:
        name: of a machine of the package or of the user, of a robot with published data, or path of a URDF file.

    Raises:
        ValueError: there is nothing of the kind, or the file cannot be read.
    """
    if name in TASKS:
        return scene_text(name)
    own = catalogue.machines()
    if name in own:
        return _text(own[name](), f'"{name}"', list(_parameters(name)))
    robots = shipped()
    if name in robots:
        return _text(robots[name](), f'{{ robot = "{name}" }}', [])
    if Path(name).suffix in (".urdf", ".xml") or Path(name).is_file():
        path = Path(name).as_posix()
        return _text(from_urdf(name), f'{{ urdf = "{path}" }}', [], "a path from the folder of this file; tip, lock")
    known = ", ".join([*own, *robots])
    raise ValueError(f"--template: no machine {name!r}, expected one of {known}, or the path of a URDF file")


def _text(arm: Manipulator, entry: str, parameters: list[str], note: str = "") -> str:
    return "\n".join([*_head(arm, entry, note), *parameters, *effect_lines(), *_limits(arm), *_task(arm)]) + "\n"


def _head(arm: Manipulator, entry: str, note: str) -> Iterator[str]:
    still = np.zeros(len(arm.coordinates))
    yield f"# A scene of the {arm.name}: machine, effects, limits and task of a motion."
    yield "# SI units and radians throughout; an angle may be given in degrees by a key that ends in _deg."
    yield "# Coordinates, in this order, with their axes where every coordinate is 0, in the base (e_3 up):"
    for c, axis in zip(arm.coordinates, joint_axes(arm, still), strict=True):
        if axis is None:
            yield f"#   {c.name} [{c.unit}] moves no body"
            continue
        way = "turns about" if axis.turns else "moves along"
        where = f" through {_vector(axis.point)} m" if axis.turns else ""
        yield f"#   {c.name} [{c.unit}] {way} {_direction(axis.direction)}{where}"
    corners = skeleton(arm, still[None])[0]
    yield f"# There the tool is at {_vector(corners[-1])} m; it points from {_vector(corners[-2])} m to there."
    weights = [f"{body.name} {body.mass:g} kg" for body in arm.bodies if isinstance(body.mass, int | float)]
    if weights:
        yield from _wrapped(f"Links, named by the joint that carries them: {', '.join(weights)}.")
    yield from (line for note in arm.notes for line in _wrapped(f"Note: {note}."))
    yield (
        "# One number for each coordinate: [1, 2, ...], or by name, { "
        + key_of(arm.coordinates[0].name)
        + " = 1, ... }."
    )
    yield ""
    yield f"machine = {entry}" + (f"  # {note}" if note else "")
    yield 'form = "canonical"'.ljust(24) + f"# {', '.join(catalogue.forms())}"
    yield f'frame = "{arm.default_frame}"'.ljust(24) + f"# {', '.join(arm.frames)}; none with inverse"
    yield ""


def _parameters(name: str) -> Iterator[str]:
    """Yield the parameters of a machine of the user, with the words of its docstring."""
    function = catalogue.machines()[name]
    words, units = argument_words(function), argument_units(function)
    yield "[parameters]            # these are the defaults; a line may be left out"
    for parameter in inspect.signature(function).parameters.values():
        if isinstance(parameter.default, int | float) and not isinstance(parameter.default, bool):
            note = "; ".join(part[parameter.name] for part in (units, words) if parameter.name in part)
            yield f"{key_of(parameter.name)} = {parameter.default!r}".ljust(24) + f"# {note or '?'}"
    yield ""


def _limits(arm: Manipulator) -> Iterator[str]:
    yield "# Along the motion: any signal of the scene (see --card), as one number for both directions or"
    yield "# { lower = ..., upper = ... }. What stands here comes before what the machine states."
    yield "[limits]"
    if arm.limits:
        yield "machine = true          # those that the data sheet or the file states:"
    for signal, words in SIGNALS.items():
        if signal in arm.limits:
            lower, upper = (_list(side) for side in arm.limits[signal])
            yield f"# {signal} = {{ lower = {lower}, upper = {upper} }}  # {words}"
    known = np.asarray(arm.limits["tau"][1] if "tau" in arm.limits else [np.inf] * len(arm.coordinates))
    if not np.isfinite(known).all():
        forces = ", ".join(c.force_unit for c in arm.coordinates)
        values = _list(np.where(np.isfinite(known), known, UNKNOWN))
        yield f"tau = {values}  # {forces}; {UNKNOWN:g} where nothing is stated: put in those of your drives"
    yield ""


def _task(arm: Manipulator) -> Iterator[str]:
    start, goal = _ends(arm)
    units = ", ".join(c.unit for c in arm.coordinates)
    yield "[task]                  # from rest to rest"
    yield f"from = {_list(start)}  # {units}"
    yield f"to = {_list(goal)}  # {units}; or {{ tool = [x, y, z], orientation_deg = [roll, pitch, yaw] }}"
    yield 'minimise = "time"       # or { time = 1.0, squares = { tau = 1e-6 }, integral = { power = 0.0 } }'
    yield "horizon = { guess = 1.0 }  # s; a free duration may have lower and upper, a fixed one is a number"
    yield "elements = 50           # of the grid"
    yield ""
    yield '# Regions that the tool stays out of (keep = "inside": stays in): ball, box, cylinder, half_space.'
    yield "# [[task.obstacles]]"
    yield '# shape = "ball"'
    yield "# centre = [0.0, 0.0, 2.0]  # m"
    yield "# radius = 0.1          # m"
    yield '# name = "ball"         # in reports'
    yield ""
    yield from collision_lines(arm)


def _ends(arm: Manipulator) -> tuple[Array, Array]:
    """Return start and goal of a task within the limits: the middle of every range, and a step away from it."""
    n = len(arm.coordinates)
    low, high = (np.asarray(side, dtype=float) for side in arm.limits.get("q", ((-np.inf,) * n, (np.inf,) * n)))
    known = np.isfinite(low) & np.isfinite(high)
    middle = np.where(known, (np.where(known, low, 0.0) + np.where(known, high, 0.0)) / 2.0, 0.0)
    step = np.where(known, np.minimum(STEP, (np.where(known, high, 0.0) - np.where(known, low, 0.0)) / 4.0), STEP)
    return np.round(middle, 3), np.round(middle + step, 3)


def _direction(values: Array) -> str:
    """Return a direction as e_1, -e_2 ... where it is one, else as numbers."""
    k = int(np.argmax(np.abs(values)))
    if np.allclose(values, np.sign(values[k]) * np.eye(3)[k], atol=1e-9):
        return f"{'-' if values[k] < 0.0 else ''}e_{k + 1}"
    return _vector(values)


def _vector(values: Array) -> str:
    return f"({', '.join(f'{float(np.round(x, 3)) + 0.0:g}' for x in values)})"


def _list(values: Array | tuple[float, ...] | list[float]) -> str:
    return f"[{', '.join(f'{float(x):.1f}' if np.round(x) == x else f'{float(x):.6g}' for x in values)}]"


def _wrapped(text: str) -> Iterator[str]:
    yield from (f"# {line}" for line in textwrap.wrap(text, 112, break_on_hyphens=False))
