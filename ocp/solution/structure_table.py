"""The table of a switching structure, made from its list of arcs."""

from __future__ import annotations

from dataclasses import replace

from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Kind, Row, Structure


def tabulate(problem: Problem, limits: tuple[StateLimit, ...], arcs: tuple[Arc, ...]) -> Structure:
    """Return the switching structure with its table, from the list of arcs.

    Args:
        problem: names the controls.
        limits: state limits of the problem.
        arcs: in order of time.
    """
    ends = [0.0]
    for arc in arcs:
        ends.append(ends[-1] + arc.duration)
    rows: list[Row] = []
    system = problem.system
    for i, label in enumerate(system.label("u", system.u.numel())):
        own: list[Row] = []
        for k, arc in enumerate(arcs):
            if own and own[-1].kind is arc.kinds[i]:
                own[-1] = own[-1]._replace(end=ends[k + 1])
            else:
                own.append(Row(label.name, arc.kinds[i], ends[k], ends[k + 1]))
        rows += own
    for number, limit in enumerate(limits):
        own = []
        for k, arc in enumerate(arcs):
            if any(contact.limit == number for contact in arc.touched):
                own.append(Row(limit.label.name, Kind.TOUCH, ends[k], ends[k]))
            if any(contact.limit == number for contact in arc.held):
                if own and own[-1].kind is Kind.LIMIT and own[-1].end == ends[k]:
                    own[-1] = own[-1]._replace(end=ends[k + 1])
                else:
                    own.append(Row(limit.label.name, Kind.LIMIT, ends[k], ends[k + 1]))
        rows += own
    return Structure(tuple(rows), arcs)


def merged(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return the arcs with neighbours joined that differ in duration only."""
    kept: list[Arc] = []
    for arc in arcs:
        if kept and kept[-1].same(arc):
            kept[-1] = replace(kept[-1], duration=kept[-1].duration + arc.duration)
        else:
            kept.append(arc)
    return tuple(kept)
