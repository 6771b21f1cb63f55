"""The fastest motion through waypoints without times, under limits of torque and speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models import Manipulator, Motion, path_system, path_through, timed
from models.mechanics.terms import Effect
from ocp import Bolza, Control, Free, Problem, Solution, along, end, radau, solve, start, uniform

Limit = Sequence[float] | np.ndarray


def fastest(
    machine: Manipulator,
    effects: Sequence[Effect],
    waypoints: np.ndarray,
    torque: Limit,
    speed: Limit | None = None,
    elements: int = 100,
) -> tuple[Motion, Solution]:
    """Return the time-optimal motion along the spline through waypoints, and the solution for its path parameter.

    Args:
        machine, effects: of numbers.
        waypoints: (K, n) [rad or m].
        torque: (n,) largest force of every drive, in both directions [N m or N].
        speed: (n,) largest speed [rad/s or m/s], or None.
        elements: of the grid.

    Raises:
        ValueError: waypoints that make no path, sizes that disagree.
    """
    path = path_through(waypoints)
    system = path_system(machine, effects, path)
    limits = [along(system["ds"], 0.0, None), along(system["tau"], -np.asarray(torque), np.asarray(torque))]
    if speed is not None:
        limits.append(along(system["v"], -np.asarray(speed), np.asarray(speed)))
    ends = (start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0))
    problem = Problem(system, Free(guess=1.0), Bolza(time=1.0), (*ends, *limits))
    solution = solve(problem, scheme=radau(3, control=Control.LINEAR), grid=uniform(elements))
    return timed(path, solution), solution
