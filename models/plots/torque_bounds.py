"""Torques that the drives of a table have at each of its times, by their own limits, those of effects and of a task."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from models.forms.lagrange_form import lagrange
from models.plots.signals import limits_of
from models.torques.torque_table import TorqueTable
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.problem.constraints import along
from ocp.system import Side

Limits = Mapping[str, tuple[Side, Side]]  # signal -> lower, upper


def drive_limits(table: TorqueTable, further: Limits | None = None) -> tuple[Array, Array]:
    """Return the least and the largest torque (K, n) of every drive at each time; -inf, inf where nothing limits it.

    Limits that depend on more than position and velocity, such as the heat of a winding, are left out, and those of
    machines whose drives have a state or a voltage.

    Args:
        table: torques with the limits of its drives, and its effects with theirs.
        further: limits on signals, such as those of a scene.
    """
    n = table.q.shape[1]
    system = lagrange(table.machine, table.effects)
    low, high = -np.full(table.tau.shape, np.inf), np.full(table.tau.shape, np.inf)
    if ca.is_equal(system.u, table.machine.tau, 2):
        known = {**system.limits, **(further or {})}
        bounds = limits_of(system.u, [along(system[name], *sides) for name, sides in known.items()], system.u)
        if not ca.depends_on(ca.vertcat(*bounds), system.x[2 * n :]):
            inputs = [system.x[: 2 * n], system.u, system.p]  # the torque stands in a limit and cancels
            function = ca.Function("limits", inputs, [ca.densify(side) for side in bounds])
            low, high = evaluate(function, np.hstack([table.q, table.v]), table.tau, table.parameters)
    if table.limits:
        own = np.stack([limit.torque(table.v[:, i]) for i, limit in enumerate(table.limits)], axis=1)
        low, high = np.maximum(low, -own), np.minimum(high, own)
    return low, high
