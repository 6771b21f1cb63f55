"""The fastest motion through waypoints without times, within limits of the drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from models import Envelope, Manipulator, Motion, path_system, timed
from models.mechanics.terms import Effect
from models.torques.limit_check import Broken, broken_limits
from ocp import Bolza, Control, Free, Problem, Solution, System, along, end, radau, solve, start, uniform
from ocp.problem.constraints import Constraint

Sides = tuple[Sequence[float], Sequence[float]]
Limits = Mapping[str, Sides]  # name of a signal -> lower and upper of every component
CLOSE = 1e-4  # share of a limit that counts as reached
TRIALS = 4  # times that the limits are lowered until the motion keeps them between the nodes


def fastest(
    machine: Manipulator,
    effects: Sequence[Effect],
    path: Motion,
    envelopes: Sequence[Envelope] = (),
    limits: Limits | None = None,
    elements: int = 100,
) -> tuple[Motion, Solution, float]:
    """Return the time-optimal motion along a path, the solution for its path parameter, and a share.

    The limits hold at the nodes of a grid; where the motion exceeds them between the nodes, the problem is solved
    again with limits that are lower by this share, so that the motion keeps the limits that were given.

    Args:
        machine, effects: of numbers; limits of the effects are kept, too.
        path: q(s), such as path_through(waypoints).
        envelopes: limits of each drive in the torque-speed plane, or none; `continuous` is not kept.
        limits: lower and upper values of signals (q, v, tau ...), such as those of a scene, or None.
        elements: of the grid.

    Raises:
        ValueError: sizes that disagree, or a path that is not smooth enough.
    """
    system = path_system(machine, effects, path)
    share = 1.0
    for _ in range(TRIALS):
        parts = [along(system["ds"], 0.0, None)]
        parts += _envelope_limits(system, envelopes, share)
        parts += _signal_limits(system, {**_own(system), **(limits or {})}, share)
        ends = (start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0))
        problem = Problem(system, Free(guess=1.0), Bolza(time=1.0), (*ends, *parts))
        solution = solve(problem, scheme=radau(3, control=Control.LINEAR), grid=uniform(elements))
        if not solution.ok:
            break
        motion = replace(timed(path, solution), notes=(*path.notes, *system.notes))
        over = exceedance(motion, machine, effects, envelopes, limits)
        if over <= 1.0 + CLOSE:
            break
        share /= over * (1.0 + CLOSE)
    return timed(path, solution), solution, 1.0 - share


def exceedance(
    motion: Motion,
    machine: Manipulator,
    effects: Sequence[Effect],
    envelopes: Sequence[Envelope],
    limits: Limits | None,
) -> float:
    """Return by which factor a motion exceeds its limits at most; at most 1 if it keeps them."""
    table = motion.torques(machine, effects, limits=list(envelopes))
    factors = [span.ratio for load in table.loads for span in load.exceeded]
    factors += [_factor(span) for span in broken_limits(table, limits)]
    return max([factor for factor in factors if np.isfinite(factor)], default=1.0)


def _factor(span: Broken) -> float:
    return abs(span.value / span.limit) if span.limit else 1.0


def _envelope_limits(system: System, envelopes: Sequence[Envelope], share: float) -> list[Constraint]:
    """Return the limits of drives: |tau| <= peak, |tau| (speed - corner) / peak + |v| <= speed, |tau v| <= power."""
    parts: list[Constraint] = []
    for i, limit in enumerate(envelopes):
        tau, v = system["tau"][i], system["v"][i]
        if np.isfinite(limit.peak):
            parts.append(along(tau, -share * limit.peak, share * limit.peak))
        if np.isfinite(limit.speed):
            falling = limit.speed - (limit.speed if limit.corner is None else limit.corner)
            if falling > 0.0 and np.isfinite(limit.peak):
                for sign in (-1.0, 1.0):
                    line = tau / limit.peak * falling / limit.speed + sign * v / limit.speed
                    parts.append(along(line, -share, share))
            else:
                parts.append(along(v, -share * limit.speed, share * limit.speed))
        if np.isfinite(limit.power):
            parts.append(along(tau * v / limit.power, -share, share))
    return parts


def _signal_limits(system: System, limits: Limits, share: float) -> list[Constraint]:
    """Return limits on signals; those of the system itself are replaced, those with a share below 1 lowered."""
    parts = []
    for name, (lower, upper) in limits.items():
        if name not in system.signals or (name in system.limits and share == 1.0):
            continue
        size = system[name].numel()
        low, high = (np.broadcast_to(np.asarray(side, dtype=float), (size,)) for side in (lower, upper))
        factor = 1.0 if name == "q" else share
        replaces = name if name in system.limits else ""
        parts.append(along(ca.densify(system[name]), factor * low, factor * high, name=replaces))
    return parts


def _own(system: System) -> dict[str, Sides]:
    """Return the limits that the system has by its effects, without open sides."""
    return {
        name: (-np.inf if low is None else low, np.inf if high is None else high)  # type: ignore[misc]
        for name, (low, high) in system.limits.items()
    }
