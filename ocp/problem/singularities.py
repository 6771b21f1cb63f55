"""Where a motion meets a singularity of its system, at which the equations are not defined."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import rates
from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Problem
from ocp.system import Singularity, System

BETWEEN = 8  # interpolated states between two states of a motion


@dataclass(frozen=True, eq=False)
class Meeting:
    """The first singularity that a motion meets."""

    row: int  # index of the state at which the singularity lies, or before which, after the one before
    at: bool  # whether it lies at this state
    words: str  # what is singular, where, and what to do


def meeting(system: System, x: Array, values: Sequence[float], start: int = 0) -> Meeting | None:
    """Return where a motion first meets a singularity of the system, or None.

    A state meets it if the absolute quantity is below its least value or NaN; a motion crosses it between two states
    if the quantity changes its sign.

    Args:
        system: with its singularities.
        x: (K, nx) states in the order of time; rows with NaN are skipped.
        values: of the parameters.
        start: index of the state whose sign of the quantity is the reference.
    """
    usable = np.flatnonzero(np.all(np.isfinite(x), axis=1))
    if not system.singular or not len(usable):
        return None
    sizes = quantities(system, x[usable], values)
    results: list[tuple[int, bool, Singularity]] = []
    first = min(int(np.searchsorted(usable, start)), len(usable) - 1)
    for singularity, size in zip(system.singular, sizes, strict=True):
        touched = ~(np.abs(size) > singularity.least)
        turned = np.sign(size) != np.sign(size[first])
        bad = np.flatnonzero(touched | turned)
        if len(bad):
            results.append((int(usable[bad[0]]), bool(touched[bad[0]]), singularity))
    if not results:
        return None
    row, at, singularity = min(results, key=lambda one: one[0])
    return Meeting(row, at, singularity.words + met_at(system, singularity, x[row]))


def between(system: System, t: Array, x: Array, u: Array, values: Sequence[float]) -> tuple[Array, Array]:
    """Return times and states of a motion with eight further states in each interval, by cubic Hermite interpolation.

    Args:
        system: x' = f(x, u, p).
        t: (K,) [s], increasing.
        x: (K, nx) states.
        u: (K, nu) controls.
        values: of the parameters.
    """
    (slope,) = evaluate(rates(system), x, u, np.array(values, dtype=float))
    s = (np.arange(BETWEEN + 1) / (BETWEEN + 1))[:, None]
    h = np.diff(t)[:, None, None]
    left, right = x[:-1, None], x[1:, None]
    inner = (
        (2 * s**3 - 3 * s**2 + 1) * left
        + (s**3 - 2 * s**2 + s) * h * slope[:-1, None]
        + (3 * s**2 - 2 * s**3) * right
        + (s**3 - s**2) * h * slope[1:, None]
    )
    times = (t[:-1, None] + s.T * np.diff(t)[:, None]).ravel()
    return np.append(times, t[-1]), np.vstack([inner.reshape(-1, x.shape[1]), x[-1:]])


def quantities(system: System, x: Array, values: Sequence[float]) -> Array:
    """Return the quantity of every singularity at states (K, nx), shape (number of singularities, K)."""
    return evaluate(_quantities(system), x, np.array(values, dtype=float))[0].T


@functools.lru_cache(maxsize=32)
def _quantities(system: System) -> ca.Function:
    every = ca.vertcat(*(singularity.quantity for singularity in system.singular))
    return ca.Function("quantities", [system.x, system.p], [ca.densify(every)])


def met_at(system: System, singularity: Singularity, x: Array) -> str:
    """Return the values of the states on which the quantity of a singularity depends, as part of a message.

    Args:
        system: that has the singularity.
        singularity: the singularity.
        x: (nx,) state.
    """
    used = {symbol.element_hash() for symbol in ca.symvar(singularity.quantity)}
    pairs = zip(ca.vertsplit(system.x), system.label("x", len(x)), x, strict=True)
    known = [f"{label.name} = {value:.3g}" for symbol, label, value in pairs if symbol.element_hash() in used]
    return f" (met at {', '.join(known)})" if known else ""


def singular_ends(phases: tuple[Problem, ...], values: list[list[float]]) -> Iterator[str]:
    """Yield messages for ends at a singularity, or on two sides of one: no motion connects them.

    Args:
        phases: the problems.
        values: of the parameters of each; quantities that depend on a free parameter are skipped.
    """
    for phase, numbers in zip(phases, values, strict=True):
        system = phase.system
        if not system.singular:
            continue
        unknown = any(c.where is Where.ALONG and simple(c, system.p) for c in phase.subject_to)
        first, last, _ = ends(phase, numbers)
        start, end = _fixed(phase, Where.START), _fixed(phase, Where.END)
        sizes = quantities(system, np.stack([first, last]), numbers)
        for singularity, (low, high) in zip(system.singular, sizes, strict=True):
            if unknown and ca.depends_on(singularity.quantity, system.p):
                continue
            used = {symbol.element_hash() for symbol in ca.symvar(singularity.quantity)}
            used -= {symbol.element_hash() for symbol in ca.vertsplit(system.p)}
            for where, known, size, x in (("start", start, low, first), ("end", end, high, last)):
                if used <= known and not abs(size) > singularity.least:
                    yield f"the {where} is singular: {singularity.words}{met_at(system, singularity, x)}"
            if used <= start and used <= end and low * high < 0.0:
                yield f"start and end lie on two sides of a singularity: {singularity.words}"


def _fixed(phase: Problem, where: Where) -> set[int]:
    """Return the hashes of the state symbols that have a fixed value at an end."""
    low, high = phase.limits(where, phase.system.x)
    pairs = zip(ca.vertsplit(phase.system.x), low, high, strict=True)
    return {symbol.element_hash() for symbol, a, b in pairs if a == b}
