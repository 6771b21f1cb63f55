"""The commented scene file of each machine, from which users start and which the command runs by default."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, dataclass, fields

from models.machines.cylindrical_arm import cylindrical
from models.machines.manipulator import Manipulator
from models.machines.parameters import Follows, unit_of
from models.machines.spherical_arm import spherical
from models.machines.torus_arm import torus
from models.rigid_bodies.clearances import without_capsules
from models.scenes import catalogue
from models.scenes.docstring_words import argument_words

# Values of parameters without a default, by unit, of a usual size.
USUAL = {
    "kg": 2.0, "kg m^2": 1e-4, "kg m^2 or kg": 1.0, "N m or N": 2.0, "N m s/rad or N s/m": 0.5, "s": 0.02, "W": 500.0,
    "N m/rad or N/m": 2e4, "rad/s or m/s": 4.0, "N m/A": 0.1, "ohm": 1.0, "K/W": 1.5, "J/K": 200.0,
}  # fmt: skip
# Two that do not suit the sizes above: breakaway friction is larger than sliding friction, and a stall torque larger.
LARGER = {("stribeck", "f_static"): 3.0, ("torque_speed", "stall"): 600.0}
# Defaults that these machines, whose joints have no rotors of their own, cannot take.
NEEDED = {("elastic_drive", "inertia")}


@dataclass(frozen=True)
class Default:
    """A default task of a machine: rest to rest within limits."""

    machine: Callable[[], Manipulator]
    q0: tuple[float, ...]  # [rad or m]
    q1: tuple[float, ...]
    q_min: tuple[float, ...]
    q_max: tuple[float, ...]
    limit: tuple[float, ...]  # largest force of every drive, in both directions [N m or N]
    coordinates: tuple[str, ...]  # what each coordinate does, and where it is zero


TASKS = {
    "spherical": Default(
        spherical,
        (0.9, 0.0, 0.0, 0.85), (1.6, 2.0, 0.5, 0.9),
        (0.15, -3.0, -3.0, 0.6), (2.8, 3.0, 3.0, 1.1), (260.0, 160.0, 3.0, 400.0),
        (
            "tilts the arm from the vertical; 0: the arm points upwards",
            "turns the column about the vertical e_3; 0: the arm tilts towards e_2",
            "spins the arm about its own axis; 0: its axes are those of the swivelling body",
            "extends the arm; 0: its mass centre is in the centre of rotation",
        ),
    ),
    "cylindrical": Default(
        cylindrical, (0.0, 0.2, 0.6), (2.0, 0.8, 0.8), (-3.0, 0.0, 0.3), (3.0, 1.2, 1.0), (150.0, 1000.0, 300.0),
        (
            "turns the column about the vertical e_3; 0: the arm extends along e_2",
            "lifts the carriage; 0: at the origin",
            "extends the arm; 0: its mass centre is beside the axis",
        ),
    ),
    "torus": Default(
        torus, (0.0, 0.4, -0.9), (2.0, 0.8, -1.3), (-3.0, -0.3, -2.6), (3.0, 2.0, 2.6), (250.0, 600.0, 220.0),
        (
            "turns the column about the vertical e_3; 0: the arm lies above e_1",
            "raises link 2; 0: horizontal",
            "bends link 3 against link 2; 0: stretched",
        ),
    ),
}  # fmt: skip


def scene_text(name: str) -> str:
    """Return the commented scene file of a machine: its defaults, gravity, a task; other effects in comments.

    Args:
        name: of the machine.
    """
    make = catalogue.machines()[name]
    return "\n".join([*_head(name, make()), *_parameters(name), *effect_lines(), *_task(make(), TASKS[name])]) + "\n"


def _head(name: str, machine: Manipulator) -> Iterator[str]:
    yield from (
        f"# A scene of the {name} manipulator: machine, effects, limits and task of a motion.",
        "# SI units and radians throughout; an angle may be given in degrees by a key that ends in _deg.",
        f"# Coordinates, in this order: {', '.join(f'{c.name} [{c.unit}]' for c in machine.coordinates)}.",
        *(f"#   {c.name} {words}" for c, words in zip(machine.coordinates, TASKS[name].coordinates, strict=True)),
        "# One number for each coordinate: [1, 2, ...], or by name, { " + machine.coordinates[0].name + " = 1, ... }.",
        "",
        f'machine = "{name}"'.ljust(24) + f"# {', '.join(catalogue.machines())}",
        'form = "canonical"'.ljust(24) + f"# {', '.join(catalogue.forms())}",
        'frame = "regular"'.ljust(24) + f"# {', '.join(machine.frames)}; none with inverse",
        "",
    )


def _parameters(name: str) -> Iterator[str]:
    yield "[parameters]            # these are the defaults; a line may be left out"
    words = argument_words(catalogue.machines()[name])
    for parameter in inspect.signature(catalogue.machines()[name]).parameters.values():
        default, note = parameter.default, f"{unit_of(parameter.name)}; {words.get(parameter.name, '')}".rstrip("; ")
        if isinstance(default, Follows):
            missing = default.name if default.factor == 1.0 else f"{default.factor:g} {default.name}"
            yield f"# {parameter.name} = ...".ljust(24) + f"# {note}; {missing} if left out"
        elif not isinstance(default, bool):
            yield f"{parameter.name} = {default!r}".ljust(24) + f"# {note}"
    yield ""


def effect_lines() -> Iterator[str]:
    """Yield the lines of all effects: gravity on, the others in comments, with what each of their numbers is."""
    yield "# Effects: only those that stand here are in the equations. Remove '# ' to switch one on."
    yield ""
    for name, kind in sorted(catalogue.effects().items(), key=lambda pair: pair[0] != "gravity"):
        lead = "" if name == "gravity" else "# "
        sentence = (inspect.getdoc(kind) or "").splitlines()[0]
        yield from (f"# {line}" for line in textwrap.wrap(sentence, 112, break_on_hyphens=False))
        yield f"{lead}[effects.{name}]"
        words = argument_words(kind)
        for field in fields(kind):
            value, unit = field.default, field.metadata.get("unit", "")
            note = "; ".join(part for part in (unit, words.get(field.name, "")) if part)
            if value is MISSING or (name, field.name) in NEEDED:
                value = LARGER.get((name, field.name), USUAL.get(unit, 1.0))
                note += ", no default"
            elif value is None:
                yield _line(f"# # {field.name} = ...", f"{note}, none if left out".lstrip(", "))
                continue
            yield _line(f"{lead}{field.name} = {_toml(value)}", note)
        yield ""


def _task(machine: Manipulator, task: Default) -> Iterator[str]:
    units = ", ".join(c.unit for c in machine.coordinates)
    half_way = [(a + b) / 2 for a, b in zip(task.q0, task.q1, strict=True)]
    forces = ", ".join(c.force_unit for c in machine.coordinates)
    yield from (
        "# Along the motion: any signal of the scene (see --card), as one number for both directions or",
        "# { lower = ..., upper = ... }.",
        "[limits]",
        f"q = {{ lower = {_toml(task.q_min)}, upper = {_toml(task.q_max)} }}  # {units}",
        f"tau = {_toml(task.limit)}  # {forces}",
        f"# v = {_toml([2.0] * len(machine.coordinates))}  # the same per second",
        "",
        "[task]                  # from rest to rest",
        f"from = {_toml(task.q0)}  # {units}",
        f"to = {_toml(task.q1)}  # {units}",
        f"# via = [{_toml(half_way)}]  # passed in this order, at any speed",
        'minimise = "time"       # or { time = 1.0, squares = { tau = 1e-6 }, integral = { power = 0.0 } }',
        "horizon = { guess = 1.0 }  # s; a free duration may have lower and upper, a fixed one is a number",
        "elements = 50           # of the grid; stiff effects, such as narrow friction, need more",
        "",
        '# Regions that the tool stays out of (keep = "inside": stays in): ball, box, cylinder, half_space.',
        "# [[task.obstacles]]",
        '# shape = "ball"',
        "# centre = [0.0, 0.0, 2.0]  # m",
        "# radius = 0.1          # m",
        '# signal = "tool"       # what keeps out of it',
        '# name = "ball"         # in reports',
        "",
        *collision_lines(machine),
    )


def collision_lines(machine: Manipulator) -> Iterator[str]:
    """Yield the lines that keep all links of a machine clear, in comments."""
    yield "# Obstacles without a signal of their own, the floor and the links themselves, for all links."
    yield "# [collisions]"
    if not machine.shapes or without_capsules(machine):
        yield "# radius = 0.05          # m, of capsules along the lines of the arm (none are known of some links)"
    yield "# clearance = 0.02       # m, kept along the whole motion"
    yield "# floor = 0.0            # m, height; leave it out for none"
    bodies = list(dict.fromkeys(shape.body for shape in machine.shapes)) or ["line 2", "line 3"]
    example = f'or pairs: [["{bodies[0]}", "{bodies[-1]}"]]' if len(bodies) > 1 else ""
    yield f"# self = true            # pairs of links that may touch; {example}".rstrip("; ")
    yield "# self_clearance = 0.0   # m, between these"


def _line(entry: str, note: str) -> str:
    return f"{entry:<23} # {note}" if note else entry


def _toml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence):
        return f"[{', '.join(_toml(one) for one in value)}]"
    return f"{value:.12g}" if isinstance(value, float) and value != int(value) else repr(value)
