"""Random rest-to-rest tasks of the three machines: ends, payload, torque limits, speed limits and friction drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects import Coulomb, Gravity, Payload, Viscous
from models.forms import canonical
from models.scenes.scene_template import TASKS
from ocp import Problem, point_to_point
from ocp.solving.prechecks import warnings_before

SPEEDS = {"rad": (1.5, 6.0), "m": (0.5, 2.0)}  # range of a joint speed limit [unit/s]
FRICTION = 0.03, 0.01, 0.3  # Coulomb force and viscous force at 1 unit/s, shares of the limit of the drive; width


@dataclass(frozen=True)
class RandomTask:
    """One task of the recipe: ends uniform within the position limits of the default task of its machine."""

    machine: str
    number: int
    q0: tuple[float, ...]
    q1: tuple[float, ...]
    payload: float  # [kg], 0 to 5
    limit: tuple[float, ...]  # of every drive, 0.5 to 2 times that of the default task [N m or N]
    speed: tuple[float, ...] | None  # joint speed limits [rad/s or m/s], in half of the tasks
    friction: bool  # in a third of them

    @property
    def name(self) -> str:
        """Machine and number."""
        return f"{self.machine}-{self.number:02d}"

    def problem(self) -> Problem:
        """Return the time-optimal motion."""
        default = TASKS[self.machine]
        effects: list[Any] = [Gravity(), Payload(self.payload)]
        if self.friction:
            dry, damping, width = FRICTION
            limit = np.array(self.limit)
            effects += [Viscous(tuple(damping * limit)), Coulomb(tuple(dry * limit), width)]
        limits: dict[str, Any] = {"q": (default.q_min, default.q_max), "tau": self.limit}
        if self.speed is not None:
            limits["v"] = self.speed
        return point_to_point(canonical(default.machine(), effects), self.q0, self.q1, **limits)


def random_tasks(machine: str, count: int = 60, seed: int = 20261129) -> Iterator[RandomTask]:
    """Yield tasks whose drives can hold both ends; the first ones are the same whatever the count.

    Args:
        machine: spherical, cylindrical or torus.
        count: how many.
        seed: of the draws.
    """
    default = TASKS[machine]
    rng = np.random.default_rng([seed, *machine.encode()])
    units = [coordinate.unit for coordinate in default.machine().coordinates]
    number = 0
    while number < count:
        q0, q1 = (tuple(rng.uniform(default.q_min, default.q_max).round(4).tolist()) for _ in range(2))
        payload, factor = round(rng.uniform(0.0, 5.0), 3), rng.uniform(0.5, 2.0, len(q0))
        speed = tuple(round(rng.uniform(*SPEEDS[unit]), 3) for unit in units)
        limit = tuple((factor * default.limit).round(2).tolist())
        task = RandomTask(
            machine, number, q0, q1, payload, limit, speed if number % 2 else None, number % 3 == 0
        )  # fmt: skip
        problem = task.problem()
        if not warnings_before(problem, [problem.system.values()]):
            yield task
            number += 1
