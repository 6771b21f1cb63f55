"""Intervals in which a motion exceeds limits of effects (torque-speed lines, powers) or of a task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.forms.lagrange_form import lagrange
from models.torques.drive_loads import SLACK
from models.torques.time_means import crossings
from models.torques.torque_table import TorqueTable
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import Side


@dataclass(frozen=True)
class Broken:
    """An interval in which a signal is outside its limits."""

    name: str  # of the component, with its unit
    start: float  # [s]
    end: float
    value: float  # farthest outside
    limit: float  # the one it breaks


def broken_limits(table: TorqueTable, further: Mapping[str, tuple[Side, Side]] | None = None) -> tuple[Broken, ...]:
    """Return the intervals in which limits of effects are exceeded, in the order of their signals.

    Limits on signals that depend on more than q, v and tau (states of drives, heat, a clock) are not checked: the
    motion alone does not determine them.

    Args:
        table: of a motion, with its effects.
        further: limits on q, v and tau (and signals of these) beside those of the effects: name -> (lower, upper).
    """
    n, rows = table.q.shape[1], table.resolved
    system = lagrange(table.machine, table.effects)
    known = ca.vertcat(system.x[: 2 * n], table.machine.tau, system.p)
    results: list[Broken] = []
    for name, (low, high) in (*system.limits.items(), *(further or {}).items()):
        signal = ca.densify(ca.vec(system[name]))
        allowed = {symbol.element_hash() for symbol in ca.vertsplit(known)}
        if any(symbol.element_hash() not in allowed for symbol in ca.symvar(signal)):
            continue
        function = ca.Function("signal", [system.x[: 2 * n], table.machine.tau, system.p], [signal])
        (values,) = evaluate(function, np.hstack([rows.q, rows.v]), rows.tau, table.parameters)
        for i, label in enumerate(system.label(name, signal.numel())):
            for side, sign in ((low, -1.0), (high, 1.0)):
                if side is not None:
                    limit = float(np.broadcast_to(np.array(side, dtype=float), (signal.numel(),))[i])
                    results += _outside(str(label), rows.t, values[:, i], limit, sign)
    return tuple(results)


def _outside(name: str, t: Array, values: Array, limit: float, sign: float) -> list[Broken]:
    excess = sign * (values - limit)
    if not np.isfinite(limit):
        return []
    results = []
    slack = SLACK * (abs(limit) or float(np.max(np.abs(values))))
    for first, after, start, end in crossings(t, excess - slack):
        worst = first + int(np.argmax(excess[first:after]))
        results.append(Broken(name, start, end, float(values[worst]), limit))
    return results
