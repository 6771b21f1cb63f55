"""Results that a study stores by default: cost, duration, peak and root mean square of every control."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ocp import checks
from ocp.solution.solution import Solution


def measures(solution: Solution) -> dict[str, float]:
    """Return cost, duration [s], and max |u_i| and sqrt(1/T integral of u_i^2 dt) of every control.

    Args:
        solution: of any status.
    """
    results = {"cost": float(solution.cost), "duration": float(solution.duration)}
    points = np.unique(np.concatenate([[0.0, 0.5, 1.0], solution.scheme.points]))
    peak = np.max(np.abs(solution.samples(points)[3]), axis=0)
    points, weights = np.polynomial.legendre.leggauss(8)
    u = solution.samples((points + 1.0) / 2.0)[3].reshape(len(solution.grid), len(points), -1)
    mean = np.einsum("k,s,ksi->i", solution.grid.widths, weights / 2.0, u**2)
    system = solution.problem.system if solution.problem is not None else None
    labels = (
        [label.name for label in system.label("u", len(peak))] if system else [f"u_{i + 1}" for i in range(len(peak))]
    )
    for name, most, square in zip(labels, peak, mean, strict=True):
        results[f"peak {name}"], results[f"rms {name}"] = float(most), float(np.sqrt(square))
    return results


def named_numbers(what: str, value: object) -> dict[str, float]:
    """Return the results of a measure or function as name -> float; None becomes NaN.

    Args:
        what: function that returned them, for the message.
        value: name -> number, truth value or None.

    Raises:
        TypeError: something else.
    """
    if not isinstance(value, Mapping):
        raise TypeError(f"{what} returned {checks.shown(value)}, expected name -> number")
    results = {}
    for name, number in value.items():
        truth = isinstance(number, bool | np.bool_)
        array = np.array(np.nan) if number is None else checks.real(float(number) if truth else number)
        if array is None or array.ndim:
            raise TypeError(f"{what} returned {checks.shown(number)} as {name!r}, expected a number")
        results[str(name)] = float(array)
    return results
