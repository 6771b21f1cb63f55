"""Switching structure of a motion: which control is at which limit, and which state limit holds, from when to when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp.problem.problem import Problem
from ocp.problem.state_constraints import StateLimit
from ocp.solution.structure import Arc, Kind, Row, Structure

PER_MOTION = 16  # elements of the whole motion, at least one for each arc


def tabulate(problem: Problem, limits: tuple[StateLimit, ...], arcs: tuple[Arc, ...]) -> Structure:
    """Return the structure that arcs stand for.

    Args:
        problem: whose controls and limits they are.
        limits: of its states.
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


def key_of(arcs: tuple[Arc, ...]) -> tuple[object, ...]:
    """Return what two structures have in common if they differ in durations only."""
    return tuple((arc.kinds, arc.held, arc.touched) for arc in arcs)


def durations(arcs: tuple[Arc, ...]) -> np.ndarray:
    """Return the durations of arcs [s]."""
    return np.array([arc.duration for arc in arcs])


def elements_of(arcs: tuple[Arc, ...], level: int = 0) -> tuple[int, ...]:
    """Return how many elements the arcs of a motion should have.

    Args:
        arcs: with their durations.
        level: how often the elements are halved.
    """
    shares = durations(arcs) / durations(arcs).sum()
    return tuple((np.maximum(np.ceil(PER_MOTION * shares), 1.0).astype(int) * 2**level).tolist())


def merged(arcs: tuple[Arc, ...]) -> tuple[Arc, ...]:
    """Return arcs without those that only continue the one before."""
    kept: list[Arc] = []
    for arc in arcs:
        if kept and kept[-1].same(arc):
            kept[-1] = replace(kept[-1], duration=kept[-1].duration + arc.duration)
        else:
            kept.append(arc)
    return tuple(kept)
