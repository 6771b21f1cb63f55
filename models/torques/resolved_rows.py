"""A torque table with so many rows that nothing is missed between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from models.torques import resolution
from models.torques.torque_functions import inverse_dynamics, time_column
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

SPIKE = 1e-3  # share of the time


class Rows(Protocol):
    """A torque table, as far as its resolution needs it; see `TorqueTable`."""

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    machine: Manipulator
    effects: tuple[Effect, ...]
    parameters: Array
    derivative: Callable[[Array, int], Array]
    smoothness: float
    knots: Array

    @property
    def drives(self) -> dict[str, Array]:
        """Quantities of the drives (K, n) by name."""

    def drives_at(self, t: Array) -> dict[str, Array]:
        """Return the quantities of the drives at times (K,)."""


def resolve_rows(table: Rows) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return t, q, v, a, tau with further rows, between which torques and speeds are linear to 5e-5 of their peaks.

    Quantities of drives with a transmission or a motor model are resolved, too. The second value are notes about
    torques that grow without bound, as at a stop in a singular position.

    Args:
        table: of a motion.
    """
    n = table.q.shape[1]
    function = inverse_dynamics(table.machine, table.effects)
    drives = _drives_matter(table)

    def evaluated(t: Array) -> Array:
        """Return q, v, a, tau and the quantities of the drives (K, m)."""
        q, v, a = (table.derivative(t, order) for order in range(3))
        (tau,) = evaluate(function, q, v, a, table.parameters, *time_column(function, t))
        return np.hstack([q, v, a, tau, *(table.drives_at(t).values() if drives else ())])

    with np.errstate(all="ignore"):  # numbers that are not finite are refused by `replaced`
        t, added = table.t, resolution.with_knots(table.t, table.knots, table.smoothness < 2)
        if not (drives or len(added) or "t" in function.name_in()):
            still = resolution.straight(t, table.q, table.v, table.a, table.tau, table.derivative)
            if np.all(still):
                return {"t": t, "q": table.q, "v": table.v, "a": table.a, "tau": table.tau}, ()
        rows = np.hstack([table.q, table.v, table.a, table.tau, *(table.drives.values() if drives else ())])
        if len(added):
            order = np.argsort(np.concatenate([t, added]), kind="stable")
            t, rows = np.concatenate([t, added])[order], np.vstack([rows, evaluated(added)])[order]
        if drives or "t" in function.name_in():
            still = np.zeros(len(t) - 1, dtype=bool)
        else:
            q, v, a, tau = _parts(rows, n)
            still = resolution.straight(t, q, v, a, tau, table.derivative)
        watched = np.ones(rows.shape[1], dtype=bool)
        watched[:n] = watched[2 * n : 3 * n] = False  # positions and accelerations
        refined = resolution.refine(t, rows, evaluated, watched, still)
    q, v, a, tau = _parts(refined.values, n)
    notes = []
    growing = refined.growing[3 * n : 4 * n] | (refined.coarse & _spike(refined.t, tau))
    for i in np.flatnonzero(growing):
        at = refined.t[int(np.argmax(np.abs(tau[:, i])))]
        notes.append(
            f"tau_{table.machine.coordinates[i].name} grows without bound towards t = {at:.6g} s, as in a singular "
            "position: its peak and its rms are those of the finest step only"
        )
    if refined.coarse and not np.any(growing):
        notes.append("the torques jump between some times, to the nearest of which they are resolved")
    return {"t": refined.t, "q": q, "v": v, "a": a, "tau": tau}, tuple(notes)


def _spike(t: Array, tau: Array) -> Array:
    """Return which torques (n,) are above half of their peak for less than a thousandth of the time."""
    size = np.abs(tau)
    high = size > 0.5 * np.max(size, axis=0)
    share = np.diff(t) @ (high[:-1] & high[1:]) / (t[-1] - t[0])
    return np.asarray((share < SPIKE) & (np.max(size, axis=0) > 1e-6 * np.max(size)))


def _drives_matter(table: Rows) -> bool:
    """Whether the drives have a model of their own, and the motion is smooth enough for it."""
    terms = assemble(table.machine, table.effects).terms
    if terms.transmission is None and terms.source is None:
        return False
    try:
        return bool(table.drives)
    except ValueError:
        return False


def _parts(rows: Array, n: int) -> list[Array]:
    return [rows[:, k * n : (k + 1) * n] for k in range(4)]
