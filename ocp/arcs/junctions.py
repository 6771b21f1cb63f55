"""Junctions of arcs at which a control does not jump: the equation that says so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp.arcs.arc_problems import ArcProblem
from ocp.arcs.limit_arcs import effect_of
from ocp.checks import Array
from ocp.problem.constraints import Where
from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Contact, Kind
from ocp.transcription.arc_layout import Condition
from ocp.transcription.guess import Guess


@dataclass(frozen=True, eq=False)
class Junction:
    """The equation of a control that does not jump between two arcs: at their junction it is at a limit of one of them.

    A control with curvature in the Hamiltonian reaches and leaves its limits, and state limits that it holds, without a
    jump. Without this equation the cost is flat in the time of the junction, to third order, and the NLP hardly
    determines it. Any control goes from one upper limit to another, such as from its bound to one that falls with
    speed, where both are the same; inequalities at the points of elements do not see that.

    Args:
        condition: of the NLP.
        flat: whether the cost is flat in the time of the junction.
        control: index.
        side: -1 for the lower, 1 for the upper bound.
        contact: the limit if it depends on states or other controls; None for a bound.
    """

    condition: Condition
    flat: bool
    control: int
    side: int
    contact: Contact | None

    def value(self, problem: Problem, limits: tuple[StateLimit, ...]) -> float:
        """Return the value that the expression of the condition must have."""
        if self.contact is not None:
            limit = limits[self.contact.limit]
            return 0.0 if limit.order else limit.at(self.contact.side)
        return float(problem.limits(Where.ALONG, problem.system.u)[(self.side + 1) // 2][self.control])


def junctions_of(
    task: ArcProblem, arcs: tuple[Arc, ...], arc: Array, ends: Array, guess: Guess
) -> tuple[Junction, ...]:
    """Return the equations of controls that do not jump where an arc ends.

    Only where nothing else changes: a control may jump where another one does, or at a touch of a state limit.

    Args:
        task: the problem.
        arcs: the structure.
        arc: (N,) index of the arc of each element.
        ends: (N + 1,) ends of the elements, shares of the motion.
        guess: of the motion, which shows whether a limit is an upper or a lower one of a control.

    Source: R. F. Hartl, S. P. Sethi, R. G. Vickson, SIAM Review 37, 1995 (regular Hamiltonian).
    """
    results = []
    for k in range(1, len(arcs)):
        before, after = arcs[k - 1], arcs[k]
        i = _only_change(before, after)
        held = [c for c in (*before.held, *after.held) if c.control == i]
        if i < 0 or after.touched or (Kind.HOLDING in (before.kinds[i], after.kinds[i]) and not held):
            continue
        own = np.flatnonzero(arc == k - 1)
        at_end, at_start = (own[-1:], (1.0,)), (own[-1:] + 1, (0.0,))
        if Kind.INTERIOR in (before.kinds[i], after.kinds[i]):
            fixed, place = (after, at_end) if before.kinds[i] is Kind.INTERIOR else (before, at_start)
            if i not in task.singular:
                results.append(_junction(task, fixed, i, place, guess.duration, True))
            continue
        share = np.array([ends[own[-1] + 1]])
        point = guess.state(share)[0], guess.control(share)[0], np.array(task.numbers)
        sides = _side(task, before, i, point), _side(task, after, i, point)
        if sides[0] == sides[1] != 0:
            results.append(_junction(task, after, i, at_end, guess.duration, False))
    return tuple(results)


def _only_change(before: Arc, after: Arc) -> int:
    """Return the index of the only control whose kind, or whose limit, changes; -1 if there are none or several."""
    count = len(after.kinds)
    own = [[(arc.kinds[i], {c for c in arc.held if c.control == i}) for i in range(count)] for arc in (before, after)]
    changed = [i for i in range(count) if own[0][i] != own[1][i]]
    others = [{c for c in arc.held if c.control < 0} for arc in (before, after)]
    return changed[0] if len(changed) == 1 and others[0] == others[1] else -1


def _side(task: ArcProblem, arc: Arc, control: int, point: tuple[Array, Array, Array]) -> int:
    """Return -1 or 1 if a control is at a lower or an upper limit, of its own or with states; 0 otherwise."""
    kind = arc.kinds[control]
    if kind in (Kind.LOWER, Kind.UPPER):
        return -1 if kind is Kind.LOWER else 1
    contact = next((c for c in arc.held if c.control == control), None)
    if contact is None or task.limits[contact.limit].order:
        return 0
    return contact.side * int(np.sign(effect_of(task.problem, task.limits[contact.limit], point, control)))


def _junction(
    task: ArcProblem, arc: Arc, control: int, place: tuple[Array, tuple[float, ...]], seconds: float, flat: bool
) -> Junction:  # fmt: skip
    """Return the equation of a control at its limit on an arc, at a place beside it."""
    low, high = (side[control] for side in task.problem.limits(Where.ALONG, task.problem.system.u))
    if arc.kinds[control] is Kind.HOLDING:
        contact = next(c for c in arc.held if c.control == control)
        chain = task.chain(contact)
        scale = np.array([task.limits[contact.limit].range / seconds ** (len(chain) - 1)])
        return Junction(Condition(chain[-1], scale, *place), flat, control, contact.side, contact)
    side = -1 if arc.kinds[control] is Kind.LOWER else 1
    width = high - low if np.isfinite(high - low) else max(abs(high if side > 0 else low), 1.0)
    return Junction(Condition(task.problem.system.u[control], np.array([width]), *place), flat, control, side, None)
