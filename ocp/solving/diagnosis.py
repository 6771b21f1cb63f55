"""What is wrong with a problem or a failed solve, in words: where, how much, and what to try."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ocp.accuracy.verification import excess
from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, simple
from ocp.problem.problem import Fixed, Free, Problem
from ocp.solution.singularity import touched
from ocp.solution.solution import Solution, Status
from ocp.solving.caveat import unresolved
from ocp.solving.first_guesses import Guess
from ocp.solving.prechecks import warnings_before
from ocp.system import Label
from ocp.transcription.schemes.scheme import Control

if TYPE_CHECKING:
    from ocp.problem.sequence import Sequence

Array = np.ndarray
NOTICEABLE = 1e-6  # share of the range beyond which a limit counts as exceeded
SHRUNK = 1e-9  # of the guessed duration
MATTERS = 1e-3  # share of its range by which a control between points may exceed its limit without a remark
NAMED = 3  # findings listed at most
FEW = 3  # values of a control below which a motion may be impossible
ROUNDING = 1e-9  # share of what a value is made of


def contradictions(problem: Problem | Sequence, values: list[list[float]]) -> Iterator[str]:
    """Yield what no motion can meet with these parameter values: limits or ends that exclude each other."""
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
        yield from _ends_outside(phase, ca.DM(numbers))
        yield from _too_far(phase, ca.DM(numbers))


def _too_far(phase: Problem, p: ca.DM) -> Iterator[str]:
    """Yield states that must travel further than limits on their rate allow in the longest duration."""
    system, horizon = phase.system, phase.horizon
    longest = horizon.duration if isinstance(horizon, Fixed) else horizon.upper
    limited = [c for c in phase.subject_to if c.where is Where.ALONG]
    if not np.isfinite(longest) or not limited:
        return
    low, high = phase.limits(Where.START, system.x)
    last_low, last_high = phase.limits(Where.END, system.x)
    expression = ca.vertcat(*(c.expression for c in limited))
    lower, upper = (np.concatenate([getattr(c, side) for c in limited]) for side in ("lower", "upper"))
    # Which limited expression is the rate of which state is found by numbers: graphs of one value may differ.
    everything = ca.Function("r", [system.x, system.u, system.p], [system.rate, expression])
    draws = np.random.default_rng(1).uniform(0.3, 0.9, (4, system.x.numel() + system.u.numel()))
    seen = [everything(d[: system.x.numel()], d[system.x.numel() :], p) for d in draws]
    rates, values = (np.array([np.array(part[i]).ravel() for part in seen]) for i in (0, 1))
    labels = _labels(phase, "x", system.x)
    alike = np.abs(rates[:, :, None] - values[:, None, :]) <= 1e-10 * np.abs(values[:, None, :])
    for i, c in np.argwhere(alike.all(axis=0)).tolist():
        label = labels[i]
        for way, fastest in ((last_low[i] - high[i], upper[c]), (low[i] - last_high[i], -lower[c])):
            if np.isfinite(way) and 0.0 < fastest < np.inf and way > fastest * longest * (1.0 + 1e-9):
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


def _ends_outside(phase: Problem, p: ca.DM) -> Iterator[str]:
    """Yield limits on expressions of the state that the start or the end breaks, where those fix the whole state.

    A problem with free parameters is not judged: another value may move the end inside.
    """
    system = phase.system
    if any(c.where is Where.ALONG and simple(c, system.p) for c in phase.subject_to):
        return
    states = [
        c
        for c in phase.subject_to
        if c.where is Where.ALONG
        and not ca.depends_on(c.expression, system.u)
        and len(simple(c, ca.vertcat(system.x, system.p))) < c.expression.numel()
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
    """Yield which rate, limit or cost is not finite on the guess, where, and on which states it depends."""
    for phase, guess, numbers in zip(_phases(problem), guesses, values, strict=True):
        system = phase.system
        expressions = [system.rate, *(c.expression for c in phase.subject_to), phase.minimise.running]
        everything = ca.vertcat(*expressions)
        function = ca.Function("all", [system.x, system.u, system.p], [ca.densify(everything)]).map(len(guess.share))
        p = np.tile(np.array(numbers, dtype=float)[:, None], len(guess.share))
        found = np.array(function(guess.x.T, guess.u.T, p))
        bad = np.argwhere(~np.isfinite(found.T))
        if not len(bad):
            continue
        names = [f"d{label.name}/dt" for label in _labels(phase, "x", system.x)]
        names += [label.name for constraint in phase.subject_to for label in phase.labels(constraint)]
        named = list(zip([*names, "the running cost"], ca.vertsplit(everything), strict=True))
        place, i = bad[0]
        name, expression = named[i]
        used = {symbol.element_hash() for symbol in ca.symvar(expression)}
        states = zip(ca.vertsplit(system.x), _labels(phase, "x", system.x), guess.x[place], strict=True)
        at = [f"{label.name} = {value:.6g}" for symbol, label, value in states if symbol.element_hash() in used]
        when = f"after {100.0 * guess.share[place]:.3g} % of the duration" if place else "at the start"
        yield (
            f"{name} is {found[i, place]} {when} of the first guess"
            f"{', where ' + ', '.join(at) if at else ''}; give a guess that avoids this place, or a model without "
            "the singularity"
        )


def explain(solutions: list[Solution], values: list[list[float]]) -> list[str]:
    """Return in words why a solve failed: the worst limits and equations of its last iterate, and what to try."""
    status = solutions[0].status
    found: list[tuple[float, str]] = []
    for number, solution in enumerate(solutions):
        phase = f" in phase {number + 1}" if len(solutions) > 1 else ""
        found += _worst(solution, phase)
    found.sort(key=lambda pair: -pair[0])
    sentences = [*touched(solutions), *(words for _, words in found[:NAMED])]
    if min(len(s.controls) * s.controls.shape[1] for s in solutions) < FEW:
        sentences.append("so few values of each control hardly lead anywhere; try a grid of ten elements or more")
    if status is Status.LIMIT:
        sentences += [words for solution in solutions for words in _shrinking(solution)]
    problems = [solution.problem for solution in solutions if solution.problem is not None]
    for problem, numbers in zip(problems, values, strict=True):
        sentences += warnings_before(problem, [numbers])
    if solutions[0].rung == "given guess":
        sentences.append("without a guess, the default ladder makes its own")
    return sentences + _remedies(status, problems, bool(found))


def remarks(solutions: list[Solution]) -> list[str]:
    """Return what is worth saying of a solved problem: a coarse grid, a duration or controls beyond their limits."""
    found = []
    for solution in solutions:
        found += unresolved(solution) + between_points(solution)
        horizon = solution.problem.horizon if solution.problem is not None else None
        if isinstance(horizon, Free) and solution.duration <= horizon.lower + SHRUNK * horizon.guess:
            found.append(
                f"the duration is at its lower limit of {horizon.lower:g} s; start and goal coincide, or nothing "
                "keeps the motion from being that short"
            )
    return found


def between_points(solution: Solution) -> list[str]:
    """Say where a collocated control leaves its limits between the points, if by a noticeable share of its range."""
    if solution.scheme.control is not Control.COLLOCATED or solution.problem is None or solution.duration <= 0.0:
        return []
    system = solution.problem.system
    t, _, _, u = solution.samples(np.linspace(0.0, 1.0, 11))
    low, high = solution.problem.limits(Where.ALONG, system.u)
    both = np.isfinite(low) & np.isfinite(high) & (high > low)
    share = np.zeros(u.shape)
    share[:, both] = (np.maximum(low - u, u - high))[:, both] / (high - low)[both]
    k, i = np.unravel_index(np.argmax(share), share.shape) if share.size else (0, 0)
    if not share.size or share[k, i] <= MATTERS:
        return []
    label = system.label("u", u.shape[1])[i]
    return [
        f"{label.name} leaves its limits between the collocation points by {100 * share[k, i]:.2g} % of its range, at "
        f"t = {t[k]:.4g} s, and the cost is too low for it; Control.CONSTANT and LINEAR keep limits everywhere"
    ]


def _worst(solution: Solution, phase: str) -> list[tuple[float, str]]:
    problem = solution.problem
    if problem is None or not np.all(np.isfinite(solution.states)) or solution.duration <= 0.0:
        return []
    found = []
    for share, figure in excess(solution, problem):
        if share > NOTICEABLE:
            kind = {"start limit": "misses its start value", "end limit": "misses its end value"}
            words = kind.get(figure.scale, "is beyond its limit")
            found.append(
                (share, f"{figure.what} {words} by {float(figure):.3g} {figure.unit} at t = {figure.at:.4g} s{phase}")
            )
    system = problem.system
    t, x, rate, u = solution.samples(solution.scheme.points)
    p = np.array([solution.values[name] for name in system.nominal])[:, None]
    function = ca.Function("f", [system.x, system.u, system.p], [ca.densify(system.rate)]).map(len(t))
    left = np.abs(rate - np.array(function(x.T, u.T, np.tile(p, len(t)))).T) * solution.duration
    left[~np.isfinite(left)] = np.inf
    size = np.max(np.abs(x), axis=0)
    size = np.maximum(size, max(1e-9 * float(np.max(size)), 1e-300))
    k, i = np.unravel_index(np.argmax(left / size), left.shape)
    if left[k, i] / size[i] > NOTICEABLE:
        label = system.label("x", x.shape[1])[i]
        amount = left[k, i] / solution.duration
        unit = f"{label.unit}/s" if label.unit else "per s"
        found.append(
            (
                left[k, i] / size[i],
                f"the motion breaks d{label.name}/dt = f by {amount:.3g} {unit} at t = {t[k]:.4g} s{phase}",
            )
        )
    return found


def _shrinking(solution: Solution) -> list[str]:
    """Name the controls without limits that let a motion of least time be ever shorter."""
    problem = solution.problem
    if problem is None or not isinstance(problem.horizon, Free) or problem.minimise.time <= 0.0:
        return []
    low, high = problem.limits(Where.ALONG, problem.system.u)
    labels = _labels(problem, "u", problem.system.u)
    endless = [one.name for one, a, b in zip(labels, low, high, strict=True) if not np.isfinite(b - a)]
    if not endless or solution.duration > 1e-3 * problem.horizon.guess:
        return []
    return [
        f"{', '.join(endless)} without limits let the motion be as short as it likes, {solution.duration:.2g} s so "
        "far; limit them, or give the duration a lower limit"
    ]


def _remedies(status: Status, problems: list[Problem], violated: bool) -> list[str]:
    if status is Status.UNBOUNDED:
        return [
            "try an upper limit of the duration, Free(guess, upper=...), limits on the states, or a cost bounded below"
        ]
    if status is Status.INFEASIBLE:
        if any(isinstance(problem.horizon, Fixed) for problem in problems):
            return ["try a longer duration: with Free() and minimise time the same limits show the shortest one"]
        return ["try wider limits, or a guess nearer to a feasible motion"]
    if status is Status.LIMIT:
        free = any(isinstance(problem.horizon, Free) for problem in problems)
        return [
            "try more iterations (Ipopt(max_iter=...)), a coarser grid first"
            + (", or a better guess of the duration" if free else "")
        ]
    return ["try another guess or a coarser grid"] if violated else []


def _labels(phase: Problem, kind: str, symbols: ca.SX) -> tuple[Label, ...]:
    if kind == "p":
        return tuple(Label(name) for name in phase.system.nominal)
    return phase.system.label(kind, symbols.numel())


def _state_names(phase: Problem) -> set[str]:
    return {label.name for label in _labels(phase, "x", phase.system.x)}


def _phases(problem: Problem | Sequence) -> tuple[Problem, ...]:
    return (problem,) if isinstance(problem, Problem) else problem.problems
