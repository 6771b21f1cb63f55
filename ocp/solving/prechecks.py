"""Checks before a solve: contradictions, ends that cannot be at rest, values that are not finite."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.arrays import largest_of_unit, probes
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import slopes
from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, single_symbols
from ocp.problem.pointwise import components_along, point_values
from ocp.problem.problem import Fixed, Free, Problem
from ocp.problem.sequence import Sequence, phases_of
from ocp.system import Label
from ocp.transcription.direct_collocation import free_parameters
from ocp.transcription.guess import Guess

ROUNDING = 1e-9  # error of a value relative to the sum of its absolute terms


def warnings_before(problem: Problem | Sequence, values: list[list[float]]) -> list[str]:
    """Return warnings (not errors) for ends at rest that the bounds on the controls cannot hold."""
    results = []
    for phase, numbers in zip(phases_of(problem), values, strict=True):
        system, p = phase.system, np.array(numbers, dtype=float)
        low, high = phase.limits(Where.ALONG, system.u)
        first, last, fixed = ends(phase, p)
        f_of, _, by_u = evaluate(slopes(system), np.stack([first, last]), np.zeros(len(low)), p)
        for words, whole, f, b in zip(("start", "end"), fixed, f_of, by_u, strict=True):
            b = b.reshape(len(low), len(f)).T
            if not whole or not len(low) or not (np.all(np.isfinite(f)) and np.all(np.isfinite(b))):
                continue
            u = np.linalg.lstsq(b, -f, rcond=None)[0]
            if not _rests(f, b * u, [label.unit for label in system.label("x", system.x.numel())]):
                continue
            noise = ROUNDING * np.maximum(np.abs(u), 1e-3 * float(np.max(np.abs(u))))
            for label, need, least, a, c in zip(system.label("u", len(u)), u, noise, low, high, strict=True):
                if need < a - least or need > c + least:
                    limit = a if need < a else c
                    results.append(
                        f"{label.name} cannot hold the {words}: {need:.4g} {label.unit} are needed at rest, the limit "
                        f"is {limit:.4g}; raise the limit above {abs(need):.4g} {label.unit} or move the {words}"
                    )
    return results


def _rests(f: Array, parts: Array, units: list[str]) -> bool:
    """Return whether contributions (nx, nu) of the controls balance the rates f (nx,) without them."""
    left, size = np.abs(f + parts.sum(axis=1)), np.abs(f) + np.abs(parts).sum(axis=1)
    return bool(np.all(left <= 1e-6 * largest_of_unit(size, units) + 1e-14 * np.max(size, initial=0.0)))


def standstill(problem: Problem, values: list[float], guess: Guess) -> tuple[Guess, float] | None:
    """Return the motion of zero duration and its cost if that is the optimum: minimum time, and the goal is the start.

    Args:
        problem: a Problem.
        values: of the parameters.
        guess: whose first controls it takes.
    """
    system, minimise = problem.system, problem.minimise
    first, last, fixed = ends(problem, values)
    timed = isinstance(problem.horizon, Free) and problem.horizon.lower == 0.0 and minimise.time > 0.0
    limited = len(free_parameters(problem)) > 0
    apart = [c for c in problem.subject_to if c.where is Where.PERIODIC]
    if not timed or not all(fixed) or limited or apart or np.any(first != last) or not minimise.running.is_zero():
        return None
    final = ca.Function("final", [system.x, system.p], [minimise.final + minimise.initial])(first, values)
    low, high = problem.limits(Where.ALONG, system.u)
    u = np.clip(guess.u[:1], low, high)
    return Guess(np.array([0.0, 1.0]), np.array([first, first]), np.vstack([u, u]), 0.0, np.zeros(0)), float(final)


def contradictions(problem: Problem | Sequence, values: list[list[float]]) -> Iterator[str]:
    """Yield messages for limits and ends that exclude each other with these parameter values."""
    for phase, numbers in zip(_phases(problem), values, strict=True):
        system = phase.system
        for kind, symbols in (("x", system.x), ("u", system.u), ("p", system.p)):
            labels = _labels(phase, kind, symbols)
            low, high = phase.limits(Where.ALONG, symbols)
            for label, a, b in zip(labels, low, high, strict=True):
                if a > b:
                    yield (
                        f"the limits of {label.name} along the motion exclude each other: at least {a:.6g}, "
                        f"at most {b:.6g} {label.unit}; loosen one"
                    )
            if kind != "x":
                continue
            for where in (Where.START, Where.END):
                for label, a, b, under, over in zip(labels, low, high, *phase.limits(where, symbols), strict=True):
                    yield from _end_against_limit(label, where.value, (a, b), (under, over))
        p = np.array(numbers, dtype=float)
        yield from _ends_outside(phase, p)
        yield from _too_far(phase, p)


def _too_far(phase: Problem, p: Array) -> Iterator[str]:
    """Yield messages for states that cannot travel far enough in the longest duration with limits on their rate."""
    system, horizon = phase.system, phase.horizon
    longest = horizon.duration if isinstance(horizon, Fixed) else horizon.upper
    limited = [c for c in phase.subject_to if c.where is Where.ALONG]
    if not limited:
        return
    lower, upper = (np.concatenate([getattr(c, side) for c in limited]) for side in ("lower", "upper"))
    if not np.isfinite(longest) and np.all(lower != 0.0) and np.all(upper != 0.0):
        return
    low, high = phase.limits(Where.START, system.x)
    last_low, last_high = phase.limits(Where.END, system.x)
    # Which expression is the rate of which state is decided by numerical values, since equal graphs may look different.
    draws = probes((4, system.x.numel() + system.u.numel()), 0.3, 0.9)
    x, u = draws[:, : system.x.numel()], draws[:, system.x.numel() :]
    rates, values, _ = evaluate(point_values(phase), x, u, p)
    values = values[:, components_along(phase)]
    labels = _labels(phase, "x", system.x)
    equal = np.abs(rates[:, :, None] - values[:, None, :]) <= 1e-10 * np.abs(values[:, None, :])
    for i, c in np.argwhere(equal.all(axis=0)).tolist():
        label = labels[i]
        for way, fastest in ((last_low[i] - high[i], upper[c]), (low[i] - last_high[i], -lower[c])):
            if np.isfinite(way) and fastest == 0.0 and way > 0.0:
                yield (
                    f"{label.name} has {way:.4g} {label.unit} to go and its rate is limited to 0; raise that limit, or "
                    "let the goal be where the start is"
                )
            elif np.isfinite(way) and 0.0 < fastest < np.inf and way > fastest * longest * (1.0 + 1e-9):
                yield (
                    f"{label.name} has {way:.4g} {label.unit} to go, which takes at least {way / fastest:.4g} s at "
                    f"its limit of {fastest:.4g} {label.unit}/s, and the duration is at most {longest:.4g} s; "
                    "allow more time or more speed"
                )


def _end_against_limit(
    label: Label, where: str, along: tuple[float, float], there: tuple[float, float]
) -> Iterator[str]:
    low, high = along
    under, over = there
    if under > over:
        yield f"{label.name} shall be {under:.6g} and {over:.6g} {label.unit} at the {where}; keep one"
    elif low <= high and (under > high or over < low):
        value, limit, side = (under, high, "above") if under > high else (over, low, "below")
        yield (
            f"{label.name} is {value:.6g} {label.unit} at the {where}, {side} its limit of {limit:.6g} by "
            f"{abs(value - limit):.3g} {label.unit}; move the {where} inside or widen the limit"
        )


def _ends_outside(phase: Problem, p: Array) -> Iterator[str]:
    """Yield messages for ends that violate a limit on an expression of the state, where the end fixes the whole state.

    A problem with free parameters is skipped: other values may satisfy the limit.
    """
    system = phase.system
    if len(free_parameters(phase)):
        return
    states = [
        c
        for c in phase.subject_to
        if c.where is Where.ALONG
        and not ca.depends_on(c.expression, system.u)
        and len(single_symbols(c, system)) < c.expression.numel()
    ]
    if not states or ca.symvar(ca.vertcat(*(c.expression for c in states))) == []:
        return
    first, last, fixed = ends(phase, p)
    for where, x, whole in ((Where.START, first, fixed[0]), (Where.END, last, fixed[1])):
        if not whole:
            continue
        for constraint in states:
            c = constraint.expression
            sizes = ca.mtimes(ca.fabs(ca.jacobian(c, system.x)), ca.fabs(system.x))
            value, size = np.array(ca.Function("c", [system.x, system.p], [ca.horzcat(c, sizes)])(x, p)).T
            size = np.nanmax(np.abs([value, size]), axis=0)  # of the terms; rounding is a share of it
            beyond = np.maximum(constraint.lower - value, value - constraint.upper)
            for label, amount, got, least in zip(phase.labels(constraint), beyond, value, size, strict=True):
                if amount > ROUNDING * least and not c.is_symbolic() and label.name not in _state_names(phase):
                    shown = f"{got:.6g} {label.unit}".strip()
                    yield (
                        f"{label.name} is {shown} at the {where.value} and breaks its limit along the "
                        f"motion by {amount:.3g}; move the {where.value} or the limit"
                    )


def not_finite(problem: Problem | Sequence, guesses: list[Guess], values: list[list[float]]) -> Iterator[str]:
    """Yield messages for rates, limits or costs that are not finite on the initial guess."""
    for phase, guess, numbers in zip(_phases(problem), guesses, values, strict=True):
        system = phase.system
        result = np.hstack(evaluate(point_values(phase), guess.x, guess.u, np.array(numbers, dtype=float)))
        bad = np.argwhere(~np.isfinite(result))
        if not len(bad):
            continue
        everything = ca.vertcat(system.rate, *(c.expression for c in phase.subject_to), phase.minimise.running)
        names = [f"d{label.name}/dt" for label in _labels(phase, "x", system.x)]
        names += [label.name for constraint in phase.subject_to for label in phase.labels(constraint)]
        named = list(zip([*names, "the running cost"], ca.vertsplit(everything), strict=True))
        node, i = bad[0]
        name, expression = named[i]
        used = {symbol.element_hash() for symbol in ca.symvar(expression)}
        states = zip(ca.vertsplit(system.x), _labels(phase, "x", system.x), guess.x[node], strict=True)
        at = [f"{label.name} = {value:.6g}" for symbol, label, value in states if symbol.element_hash() in used]
        when = f"after {100.0 * guess.share[node]:.3g} % of the duration" if node else "at the start"
        yield (
            f"{name} is {result[node, i]} {when} of the first guess"
            f"{', where ' + ', '.join(at) if at else ''}; give a guess that avoids this state, or a model without "
            "the singularity"
        )


def _labels(phase: Problem, kind: str, symbols: ca.SX) -> tuple[Label, ...]:
    if kind == "p":
        return tuple(Label(name) for name in phase.system.nominal)
    return phase.system.label(kind, symbols.numel())


def _state_names(phase: Problem) -> set[str]:
    return {label.name for label in _labels(phase, "x", phase.system.x)}


def _phases(problem: Problem | Sequence) -> tuple[Problem, ...]:
    return (problem,) if isinstance(problem, Problem) else problem.problems
