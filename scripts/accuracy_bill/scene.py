"""Scenes of the accuracy bill: a problem in each of its forms, and its optimum where one is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.problems import CASES

from models import Manipulator, inverse_dynamics
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.scenes.catalogue import machines
from models.scenes.scene_template import TASKS
from ocp import Free, Problem, point_to_point
from ocp.checks import Array

FORMS = {"canonical": canonical, "hamel": hamel, "lagrange": lagrange}


@dataclass(frozen=True, eq=False)
class Motion:
    """A smooth motion from rest: the drives hold the weight, and swing about that by a share of their limits."""

    machine: Manipulator
    q0: Array  # (n,) [rad or m]
    limit: Array  # (n,) [N m or N]
    share: float = 0.05
    frequency: float = 3.0  # [rad/s]
    horizon: float = 1.0  # [s]

    def drive(self) -> Callable[[float], Array]:
        """Return tau(t)."""
        rest = np.zeros(len(self.q0))
        hold = np.array(inverse_dynamics(self.machine, [Gravity()])(self.q0, rest, rest, [])).ravel()
        swing = self.share * self.limit
        return lambda t: np.asarray(hold + swing * np.cos(self.frequency * t))


@dataclass(frozen=True, eq=False)
class Scene:
    """A problem that can be written in several forms, all with the same optimum."""

    name: str
    title: str
    problems: Mapping[str, Callable[[], Problem]]  # by form; every call writes the equations anew
    known: float = float("nan")  # optimal cost with all its digits; nan if it has to be found
    peer: str = ""  # name among the problems of the benchmark, which other tools solve
    motion: Motion | None = None  # to be simulated; None for a user's ODE

    @property
    def free(self) -> bool:
        """Whether the duration is free, so that the cost is t_f."""
        return isinstance(next(iter(self.problems.values()))().horizon, Free)

    @property
    def quantity(self) -> tuple[str, str]:
        """What the error is measured in: name and unit of the cost."""
        return ("t_f", "s") if self.free else ("J", "")


def machine_scene(
    name: str,
    q0: Sequence[float] | None = None,
    q1: Sequence[float] | None = None,
    limit: Sequence[float] | None = None,
) -> Scene:
    """Return the default task of a machine with gravity, or another rest-to-rest task of it in minimum time.

    Args:
        name: of the machine in scripts/template.py.
        q0, q1: (n,) start and end [rad or m]; None for the default task.
        limit: (n,) largest force of every drive, in both directions [N m or N].

    Raises:
        ValueError: sizes disagree.
    """
    task = TASKS[name]
    own = q0 is None and q1 is None and limit is None
    values = [np.array(given or default, dtype=float) for given, default in
              ((q0, task.q0), (q1, task.q1), (limit, task.limit))]  # fmt: skip
    for what, value in zip(("from", "to", "limit"), values, strict=True):
        if len(value) != len(task.q0):
            raise ValueError(f"{what}: got {len(value)} numbers, {name} has {len(task.q0)} coordinates")

    def maker(form: str) -> Callable[[], Problem]:
        def make() -> Problem:
            arm = FORMS[form](machines()[name](), [Gravity()])
            return point_to_point(arm, values[0], values[1], q=(task.q_min, task.q_max), tau=values[2])

        return make

    title = f"{name} manipulator with gravity, minimum time{'' if own else ', task of the user'}"
    peer = {"spherical": "P2"}.get(name, name) if own else ""
    return Scene(
        name,
        title,
        {form: maker(form) for form in FORMS},
        peer=peer,
        motion=Motion(machines()[name](), values[0], values[2]),
    )


def problem_scene(name: str) -> Scene:
    """Return a problem of the benchmark: a user's ODE, in the one form it comes in."""
    case = CASES[name]()
    return Scene(name, case.title, {"ode": lambda: CASES[name]().problem()}, case.known, name)
