"""What a sensitivity analysis returns: derivatives of an optimum, and of its motion, with respect to numbers."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.problem.problem import Problem
from ocp.sensitivities.kkt_root import Optimum
from ocp.sensitivities.limit_sensitivities import LimitSensitivity, sensitivities_to_limits
from ocp.sensitivities.motion_derivatives import Held, Variation
from ocp.sensitivities.nlp_of_solution import Reconstruction
from ocp.solution.solution import Solution
from ocp.system import Label


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of an optimum with respect to numbers, per unit of the number.

    Args:
        solution: that was differentiated.
        names: of the numbers: parameters, and the keys of `toward`.
        duration: name -> [s/unit].
        cost: name -> [cost/unit].
        free: name -> derivatives of the parameters that are unknowns, by their names.
        switching: name -> (A - 1,) of the times between the arcs of `solution.structure` [s/unit]; None if the
            solution is not polished.
        valid: name -> (for a smaller number, for a larger one), whether the derivative holds on that side.
        notes: sentences about derivatives that are one-sided, not determined or not accurate.
        variations: name -> derivative of the motion.
        seconds: wall-clock time of the computation.
        reconstruction, root: the solution as unknowns of its NLP, and the root of its conditions of optimality.
    """

    solution: Solution
    names: tuple[str, ...]
    duration: Mapping[str, float]
    cost: Mapping[str, float]
    free: Mapping[str, Mapping[str, float]]
    switching: Mapping[str, Array] | None
    valid: Mapping[str, tuple[bool, bool]]
    notes: tuple[str, ...]
    variations: Mapping[str, Variation]
    seconds: float
    reconstruction: Reconstruction
    root: Optimum

    @functools.cached_property
    def limits(self) -> tuple[LimitSensitivity, ...]:
        """Derivatives of the cost with respect to every active limit and boundary value, from the multipliers."""
        return sensitivities_to_limits(self.reconstruction, self.root)

    @property
    def problem(self) -> Problem:
        """The problem that was solved."""
        return self.reconstruction.problem

    def x(self, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return name -> derivative of the state at times t, (K, nx), or (nx,) for a scalar."""
        return self.signal("x", t, held)

    def u(self, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return name -> derivative of the control at times t, (K, nu), or (nu,) for a scalar."""
        return self.signal("u", t, held)

    def signal(self, signal: str | ca.SX, t: Array | float, held: Held = Held.SHARE) -> dict[str, Array]:
        """Return the derivatives of a signal at times t.

        At a fixed share or time, a control that jumps has no derivative at its switches. With Held.ARC the point moves
        with the switches, and the derivative exists everywhere.

        Args:
            signal: name of a signal ("q", ..., also "x", "u"), or an expression (m,) in x, u, p.
            t: times [s] within the motion, (K,) or scalar.
            held: what is fixed: the share of the duration, the time, or the share of the arc.

        Returns:
            name -> (K, m), or (m,) for a scalar [unit of the signal per unit of the number].

        Raises:
            TypeError: held is no Held.
            ValueError: t lies outside the motion.
            KeyError: no such signal.
        """
        checks.instance("held", held, Held, ", ".join(map(str, Held)))
        checks.instance("signal", signal, str | ca.SX, "the name of a signal or an expression")
        system = self.problem.system
        known = {"x": system.x, "u": system.u}
        expression = signal if isinstance(signal, ca.SX) else known[signal] if signal in known else system[signal]
        system.check_symbols("signal", expression)
        self.solution.locate(t)
        times = np.atleast_1d(np.asarray(t, dtype=float))
        every = {
            name: one.signal(self.solution, self.problem, expression, times, held)
            for name, one in self.variations.items()
        }
        return every if np.ndim(t) else {name: result[0] for name, result in every.items()}

    def switches(self, control: str) -> dict[str, Array]:
        """Return name -> derivatives of the times that `solution.structure.switches(control)` gives [s/unit].

        Raises:
            ValueError: the solution is not polished, or there is no such control.
        """
        structure = self.solution.structure
        if structure is None or self.switching is None:
            raise ValueError("switches: this solution has no switching structure; take the sensitivity of polish(...)")
        starts = np.cumsum([arc.duration for arc in structure.arcs])[:-1]
        chosen = [int(np.argmin(np.abs(starts - t))) for t in structure.switches(control)]
        return {name: result[chosen] for name, result in self.switching.items()}

    def labels(self, signal: str, name: str) -> tuple[Label, ...]:
        """Return names and units of the components of `signal(signal, ...)[name]`.

        Raises:
            TypeError: an argument is no string.
            KeyError: no such signal.
            ValueError: no such number.
        """
        system = self.problem.system
        checks.text("signal", signal, "the name of a signal")
        if not isinstance(name, str) or name not in self.names:
            raise checks.refused("name", name, f"one of {', '.join(self.names)}")
        size = (system.x if signal == "x" else system.u if signal == "u" else system[signal]).numel()
        return tuple(
            Label(f"d {one.name} / d {name}", f"{one.unit or '1'} per unit of {name}")
            for one in system.label(signal, size)
        )

    def __str__(self) -> str:
        width = max(len(name) for name in self.names)
        lines = [f"{'per unit of':{max(width, 11)}s}  duration [s]  cost"]
        lines += [f"{n:{max(width, 11)}s}  {self.duration[n]:<12.6g}  {self.cost[n]:<.6g}" for n in self.names]
        return "\n".join([*lines, *self.notes])
