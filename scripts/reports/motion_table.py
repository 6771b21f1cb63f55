"""A solved motion as a table: times, positions, velocities, accelerations, drive torques."""

from __future__ import annotations

import csv
from pathlib import Path

import casadi as ca
import numpy as np

from models import Manipulator, Scene, recover
from models.plots.signals import phases
from ocp import SequenceSolution, Solution, System
from ocp.numerics.files import written_whole


def tabulate(solution: Solution | SequenceSolution, scene: Scene) -> tuple[np.ndarray, np.ndarray, str]:
    """Return times (K,) and q, v, a, tau (K, 4 n) at the collocation points, each from inside its element.

    The torques are recovered by Lagrange inverse dynamics where q(t) fixes them, else they are those of the solution.

    Args:
        solution: of a problem whose system is that of the scene.
        scene: machine and effects.

    Returns:
        times, table, and why the torques are not recovered; "" if they are.
    """
    system, reason = scene.system, ""
    try:
        function = recover(system, scene.machine, scene.effects)
    except ValueError as error:
        function, reason = _as_solved(system), str(error)
    times, rows = [], []
    legs, begins = phases(solution)
    for leg, begin in zip(legs, begins, strict=True):
        t, x, rate, u = leg.samples(leg.scheme.points)
        inputs = [x.T, rate.T, parameters(leg, len(t))] + ([u.T] if reason else [])
        result = function.map(len(t))(*inputs)
        times.append(begin + t)
        rows.append(np.vstack([np.array(part) for part in result]).T.reshape(len(t), -1))
    return np.concatenate(times), np.vstack(rows), reason


def at_points(leg: Solution, system: System, name: str, points: np.ndarray) -> np.ndarray:
    """Return a signal (K, m) at points of every element, each from inside its element."""
    t, x, _, u = leg.samples(points)
    function = ca.Function("signal", [system.x, system.u, system.p], [ca.densify(system[name])])
    return np.array(function.map(len(t))(x.T, u.T, parameters(leg, len(t)))).T


def parameters(leg: Solution, count: int) -> np.ndarray:
    """Return the parameter values (np, count) of a motion, the same at all times."""
    return np.tile(leg.parameters[:, None], count)


def finite(value: float) -> float | None:
    """Return a number, or None where JSON has none for it."""
    return value if np.isfinite(value) else None


def _as_solved(system: System) -> ca.Function:
    rate = ca.SX.sym("rate", system.x.numel())
    a = ca.jtimes(system["v"], system.x, rate)
    outputs = [ca.densify(part) for part in (system["q"], system["v"], a, system["tau"])]
    return ca.Function("as_solved", [system.x, rate, system.p, system.u], outputs)


def write_csv(path: Path, machine: Manipulator, times: np.ndarray, table: np.ndarray) -> None:
    """Write t, q, v, a, tau with names and units in the header; the file appears when it is complete."""
    names, units = [c.name for c in machine.coordinates], [c.unit for c in machine.coordinates]
    header = ["t [s]"]
    header += [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    header += [f"d{name}/dt [{unit}/s]" for name, unit in zip(names, units, strict=True)]
    header += [f"d2{name}/dt2 [{unit}/s^2]" for name, unit in zip(names, units, strict=True)]
    header += [f"tau_{c.name} [{c.force_unit}]" for c in machine.coordinates]
    with written_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([repr(float(t)), *map(repr, map(float, row))] for t, row in zip(times, table, strict=True))
