"""Results that a study of a scene stores for every motion: duration, drives, work.

The code of these functions, docstrings included, is part of the identity of stored studies: any change makes every
stored case of every scene stale. Results to be added belong into a function of their own.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ocp import Solution, System

GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(8)


def measures(solution: Solution) -> dict[str, float]:
    """Return cost, duration [s], largest and root mean square force of every drive, largest speeds, work and loss [J].

    work is what the drives deliver, braking not counted; net with braking counted as recovered.

    Args:
        solution: of a system with the signals tau and v.
    """
    assert solution.problem is not None
    system = solution.problem.system
    places = (GAUSS + 1.0) / 2.0
    tau, v = _signals(solution, places)
    weights = (solution.duration * solution.grid.widths[:, None] * WEIGHTS / 2.0).ravel()
    power = tau * v
    most = [np.max(np.abs(part), axis=0) for part in _signals(solution, np.concatenate([[0.0], places, [1.0]]))]
    mean = np.sqrt(weights @ tau**2 / solution.duration)
    results = {"cost": float(solution.cost), "duration": float(solution.duration)}
    for k, label in enumerate(system.label("tau", tau.shape[1])):
        results[f"peak {label.name}"], results[f"rms {label.name}"] = float(most[0][k]), float(mean[k])
    for k, label in enumerate(system.label("v", v.shape[1])):
        results[f"peak {label.name}"] = float(most[1][k])
    results["work"] = float(weights @ np.sum(np.maximum(power, 0.0), axis=1))
    results["net"] = float(weights @ np.sum(power, axis=1))
    results["peak power"] = float(np.max(np.abs(np.sum(power, axis=1))))
    return results


def _signals(solution: Solution, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return tau and v (K, n) at places of every element, each seen from inside of it."""
    assert solution.problem is not None
    t, x, _, u = solution.samples(places)
    # A study hands over what the solver returned, whose values are in the order of the system (Solution.parameters).
    p = np.tile(np.array(list(solution.values.values()))[:, None], len(t))
    tau, v = _function(solution.problem.system).map(len(t))(x.T, u.T, p)
    return np.array(tau).T, np.array(v).T


@functools.lru_cache(maxsize=16)
def _function(system: System) -> ca.Function:
    outputs = [ca.densify(system["tau"]), ca.densify(system["v"])]
    return ca.Function("drives", [system.x, system.u, system.p], outputs)
