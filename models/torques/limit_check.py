"""Where a motion breaks the limits that the effects of a scene set: torque-speed lines, powers, ranges."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.forms.lagrange_form import lagrange
from models.torques.drive_loads import SLACK, runs
from models.torques.torque_table import TorqueTable
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate


@dataclass(frozen=True)
class Broken:
    """An interval in which a signal is outside its limits."""

    name: str  # of the component, with its unit
    start: float  # [s]
    end: float
    value: float  # farthest outside
    limit: float  # the one it breaks


def broken_limits(table: TorqueTable) -> tuple[Broken, ...]:
    """Return the intervals in which the limits of effects are broken, in the order of their signals.

    Limits on signals that depend on more than q, v and tau (states of drives, heat, a clock) are left out: the motion
    alone does not fix them.

    Args:
        table: of a motion, with its effects.
    """
    n = table.q.shape[1]
    system = lagrange(table.machine, table.effects)
    known = ca.vertcat(system.x[: 2 * n], table.machine.tau, system.p)
    results: list[Broken] = []
    for name, (low, high) in system.limits.items():
        signal = ca.densify(ca.vec(system[name]))
        allowed = {symbol.element_hash() for symbol in ca.vertsplit(known)}
        if any(symbol.element_hash() not in allowed for symbol in ca.symvar(signal)):
            continue
        function = ca.Function("signal", [system.x[: 2 * n], table.machine.tau, system.p], [signal])
        (values,) = evaluate(function, np.hstack([table.q, table.v]), table.tau, table.parameters)
        for i, label in enumerate(system.label(name, signal.numel())):
            for side, sign in ((low, -1.0), (high, 1.0)):
                if side is not None:
                    limit = float(np.broadcast_to(np.array(side, dtype=float), (signal.numel(),))[i])
                    results += _outside(str(label), table.t, values[:, i], limit, sign)
    return tuple(results)


def _outside(name: str, t: Array, values: Array, limit: float, sign: float) -> list[Broken]:
    excess = sign * (values - limit)
    spans = runs(excess > SLACK * max(1.0, abs(limit)))
    worst = [first + int(np.argmax(excess[first:after])) for first, after in spans]
    return [
        Broken(name, float(t[first]), float(t[after - 1]), float(values[k]), limit)
        for (first, after), k in zip(spans, worst, strict=True)
    ]
