"""Polish a solution: switching times as unknowns, so that no switch lies inside an element."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ocp.arcs import ArcMotion, solve_arcs, undetermined
from ocp.certificate import Certificate, certify
from ocp.collocation import Control, Scheme, legendre
from ocp.diagnosis import between_points
from ocp.grid import Grid
from ocp.ipopt import Ipopt
from ocp.phases import from_solution
from ocp.problem import Problem
from ocp.reading import contacts, read
from ocp.revision import revise, swapped, without_shortest_hold, without_vanished
from ocp.solution import Solution, Status, Timings
from ocp.solver import solve
from ocp.statelimit import StateLimit, state_limits
from ocp.structure import Arc, Kind, tabulate
from ocp.switching import switching_functions

Array = np.ndarray
SETTINGS = Ipopt(tol=1e-10, max_iter=60, progress=False, extra={"mu_init": 1e-6, "acceptable_iter": 0})
PER_MOTION = 16  # elements of the whole motion at first, at least one for each arc
DOUBLINGS = 3  # of the elements, until the residual is small enough
RESIDUAL = 1e-7  # local error of the dynamics on an element that is small enough
REVISIONS = 16  # structures tried for one reading
FAILURES = 2  # structures that lead nowhere, tried for one reading
READINGS = 3  # the second and third after refining the grid where the structure is in doubt
PATIENCE = 5.0, 1.0  # times the seconds of the given solve, plus so many; no further structure is tried after that
GAP = 1e-7  # share of the cost that wrong controls may leave
EXCESS = 1e-7  # share of its range by which a state limit may be exceeded
WEIGHT = 1e-2  # of undetermined controls, share of the cost per second; halved with each step
PROXIMAL, PRICE = 8, 1e-11  # steps until their price is this share of the cost


@dataclass(frozen=True, eq=False)
class _Try:
    """What came of one reading."""

    motion: ArcMotion | None
    certificate: Certificate | None
    reason: str
    iterations: int


def polish(
    solution: Solution, problem: Problem | None = None, scheme: Scheme | None = None, solver: Ipopt | None = None
) -> Solution:
    """Solve again with the durations of the arcs as unknowns, controls at their limits pinned.

    The arcs (each control at its lower or upper limit, interior, or holding a state limit) are read from controls,
    switching functions and state limits. On an arc where a limit c <= c_max of order r holds, c^(r) = 0 determines its
    control, with c = c_max, c' = ... = 0 at the entry; a touch has c = c_max, c' = 0 at one instant. Then arcs that
    vanish are dropped, contacts with a multiplier of the wrong sign released, contacts added where a limit is exceeded,
    and arcs inserted where a switching function has the wrong sign, until nothing is wrong. Where the structure is in
    doubt, the grid is refined there and read again.

    Interior arcs of controls that enter the Hamiltonian linearly are singular: a price on the distance from the last
    iterate keeps them from chattering and is iterated away (proximal point); what is left of it is in the message.

    Args:
        solution: solved, of a Problem.
        problem: needed only for a solution loaded without it.
        scheme: with collocated control, default legendre(6, control=Control.COLLOCATED).
        solver: settings of IPOPT.

    Returns:
        The polished solution with its `structure`; or the given one with structure None and the reason in its message:
        the polished one counts only if it is solved, confirms or improves the cost, and meets the sign conditions.
        `timings` are those of polishing alone: derivatives and solver of its last solve, set-up for all before it.

    Raises:
        TypeError: no Solution, or a scheme whose control is not collocated.
        ValueError: a solution loaded without its problem.

    Source: Kaya, Noakes, Computational method for time-optimal switching control, J. Optim. Theory Appl. 117, 2003;
        Hartl, Sethi, Vickson, SIAM Review 37, 1995; Rockafellar, Monotone operators and the proximal point algorithm,
        SIAM J. Control Optim. 14, 1976.
    """
    begun = time.perf_counter()
    if not isinstance(solution, Solution):
        raise TypeError(f"polish: got {solution!r}, expected a Solution of a Problem")
    problem = problem or solution.problem
    if problem is None:
        raise ValueError("polish: this solution was loaded without its model; pass problem=...")
    scheme = legendre(6, Control.COLLOCATED) if scheme is None else scheme
    if not isinstance(scheme, Scheme) or scheme.control is not Control.COLLOCATED:
        raise TypeError(f"polish: scheme is {scheme!r}, expected one with control=Control.COLLOCATED")
    if scheme.slope_at_start:
        raise TypeError(f"polish: scheme is {scheme!r}, expected radau or legendre")
    settings = SETTINGS if solver is None else solver
    if not solution.ok:
        return _unpolished(solution, "it is not a solved one")
    if solution.duration <= 0.0:
        return _unpolished(solution, "it has no duration")
    limits = state_limits(problem)
    together = [limit for limit in limits if limit.order == 0 and _couples(problem, limit)]
    for hold in contacts(problem, solution, limits)[0] if together else []:
        if limits[hold.contact.limit] in together:
            name = limits[hold.contact.limit].label.name
            return _unpolished(solution, f"{name} limits several controls together; arcs are those of single controls")
    allowed = solution.cost + _doubt(problem, solution)
    coarse, reason, iterations = solution, "", 0
    until = begun + PATIENCE[0] * solution.timings.total + PATIENCE[1]
    for reading in range(READINGS):
        tried = _settle(problem, limits, coarse, scheme, settings, until)
        iterations += tried.iterations
        reason = reason or tried.reason
        if tried.motion is not None and tried.certificate is not None:
            if tried.motion.answer.cost - tried.motion.price <= allowed:
                spent = iterations, time.perf_counter() - begun
                found = _polished(problem, limits, solution, tried, scheme, spent)
                loose = between_points(found)
                if not loose:
                    return found
                reason = loose[0]
            else:
                cost = tried.motion.answer.cost
                reason = f"the structure read leads to a cost of {cost:.9g}, more than {solution.cost:.9g}"
        if reading + 1 == READINGS or time.perf_counter() > until:
            break
        finer = solve(problem, coarse.scheme, _finer(problem, coarse, limits), Ipopt(progress=False), coarse,
                      solution.values)  # fmt: skip
        iterations += finer.iterations
        if not finer.ok:
            break
        coarse = finer
    return _unpolished(solution, reason)


def _couples(problem: Problem, limit: StateLimit) -> bool:
    """Return whether a limit depends on more than one control."""
    return sum(ca.which_depends(limit.chain[-1], problem.system.u, 1, False)) > 1


def _settle(
    problem: Problem, limits: tuple[StateLimit, ...], coarse: Solution, scheme: Scheme, settings: Ipopt, until: float
) -> _Try:
    """Read a structure, solve it and revise it until nothing is wrong."""
    arcs, guess = read(problem, coarse, limits), from_solution(coarse)
    seen: set[tuple[object, ...]] = set()
    solves = iterations = level = steps = failures = 0
    settled: _Try | None = None
    singular = set(undetermined(problem).tolist())
    while solves < REVISIONS + DOUBLINGS + PROXIMAL and (solves == 0 or time.perf_counter() < until):
        elements = _elements(arcs, level)
        loose = any(arc.kinds[i] is Kind.INTERIOR for arc in arcs for i in singular)
        weight = WEIGHT * 0.5**steps * abs(coarse.cost) / coarse.duration if loose else 0.0
        begin = replace(settings, extra={**settings.extra, "mu_init": 1e-2}) if loose and steps == 0 else settings
        motion = solve_arcs(problem, limits, arcs, elements, scheme, guess, coarse.values, begin, weight)
        solves, iterations = solves + 1, iterations + motion.answer.iterations
        seen.add(_key(arcs))
        if motion.answer.status is not Status.SOLVED:
            if settled is not None:
                return replace(settled, iterations=iterations)  # only its residual could have been smaller
            failures += 1
            others = swapped(motion.arcs), without_shortest_hold(arcs), without_vanished(motion.arcs)
            other = next((o for o in others if _key(o) not in seen), None)
            if other is not None and failures <= FAILURES:
                arcs = tuple(replace(a, duration=max(a.duration, 1e-6 * coarse.duration)) for a in other)
                continue
            words = f"the arcs that were read lead nowhere ({motion.answer.verbatim})"
            return _Try(None, None, words, iterations)
        parameters = _parameters(problem, coarse, motion)
        certificate = certify(problem, limits, motion, scheme, parameters)
        solution = _as_solution(problem, coarse, motion, scheme, parameters)
        sound = certificate.gap <= GAP and all(c.share <= EXCESS for c in certificate.crossings)
        sound = sound and not certificate.jumps and not certificate.released
        revised = revise(motion, certificate, limits)
        if (not sound or len(revised) < len(motion.arcs)) and _key(revised) not in seen:
            arcs, guess, steps = revised, from_solution(solution), 0
            continue
        regularised = motion.price > PRICE * abs(motion.answer.cost) and steps < PROXIMAL
        if not sound and regularised and not (certificate.signs or certificate.crossings or certificate.jumps):
            # What is wrong is inside singular arcs, and the price on them does that.
            arcs, guess, steps = motion.arcs, from_solution(solution), steps + 1
            continue
        if not sound and level >= 1:
            return _Try(None, None, _what(problem, limits, certificate), iterations)
        settled = _Try(motion, certificate, "", iterations) if sound else None
        if not sound or (float(np.max(solution.error)) > RESIDUAL and level < DOUBLINGS):
            arcs, guess, level = motion.arcs, from_solution(solution), level + 1
            continue
        if regularised:
            arcs, guess, steps = motion.arcs, from_solution(solution), steps + 1
            continue
        return _Try(motion, certificate, "", iterations)
    return _Try(None, None, "the structure does not settle", iterations)


def _key(arcs: tuple[Arc, ...]) -> tuple[object, ...]:
    return tuple((arc.kinds, arc.held, arc.touched) for arc in arcs)


def _elements(arcs: tuple[Arc, ...], level: int) -> tuple[int, ...]:
    total = sum(arc.duration for arc in arcs)
    return tuple(max(1, int(np.ceil(PER_MOTION * arc.duration / total))) * 2**level for arc in arcs)


def _what(problem: Problem, limits: tuple[StateLimit, ...], certificate: Certificate) -> str:
    """Return in words what is left wrong."""
    if certificate.crossings and certificate.crossings[0].share > EXCESS:
        worst = certificate.crossings[0]
        label = limits[worst.contact.limit].label
        return f"{label.name} exceeds its limit by {worst.share:.1e} of its range at {worst.worst:.6g} s"
    if certificate.jumps or certificate.released:
        contact = certificate.jumps[0].contact if certificate.jumps else certificate.released[0][1]
        return f"the multiplier of the limit of {limits[contact.limit].label.name} has the wrong sign"
    words = f"the switching functions leave a gain of {certificate.gap:.1e} of the cost"
    if certificate.signs:
        worst_sign = certificate.signs[0]
        system = problem.system
        name = system.label("u", system.u.numel())[worst_sign.control].name
        words += f", most of it by {name} from {worst_sign.start:.6g} to {worst_sign.end:.6g} s"
    return words


def _doubt(problem: Problem, solution: Solution) -> float:
    """Return by how much the cost of a solution may be too low, to first order."""
    _, x, _, u = solution.samples(solution.scheme.points)
    costates = solution.costates.reshape(len(x), -1)
    found = switching_functions(problem, x, u, costates, list(solution.values.values()))
    weights = (solution.duration * solution.grid.widths[:, None] * solution.scheme.weights).ravel()
    return float(weights @ found.gains.sum(axis=1)) + 1e-6 * abs(solution.cost)


def _finer(problem: Problem, solution: Solution, limits: tuple[StateLimit, ...]) -> Grid:
    """Return the grid with elements in four where a control is between its limits or a state limit begins or ends."""
    holds, touches = contacts(problem, solution, limits)
    doubtful = {t for t, _ in touches} | {t for hold in holds for t in (hold.start, hold.end)}
    starts = np.cumsum([arc.duration for arc in read(problem, solution, limits)])[:-1]
    ends = solution.grid.ends
    split = np.zeros(len(solution.grid), dtype=bool)
    for t in (*doubtful, *starts.tolist()):
        k = int(solution.grid.locate(np.array([t / solution.duration]))[0])
        split[max(k - 1, 0) : k + 2] = True
    marks = [np.linspace(a, b, 5 if cut else 2)[:-1] for a, b, cut in zip(ends[:-1], ends[1:], split, strict=True)]
    return Grid(np.append(np.concatenate(marks), 1.0))


def _parameters(problem: Problem, coarse: Solution, motion: ArcMotion) -> list[float]:
    values = {**coarse.values, **dict(zip(coarse.free, motion.free.tolist(), strict=True))}
    return [values[name] for name in problem.system.nominal]


def _as_solution(
    problem: Problem, coarse: Solution, motion: ArcMotion, scheme: Scheme, parameters: list[float]
) -> Solution:
    """Return the motion as a Solution, without structure and seconds."""
    slopes = np.zeros((len(motion.grid), 0, motion.states.shape[2]))
    free = dict(zip(coarse.free, motion.free.tolist(), strict=True))
    values = dict(zip(problem.system.nominal, parameters, strict=True))
    return replace(
        coarse, status=motion.answer.status, solver_status=motion.answer.verbatim, duration=motion.duration,
        cost=motion.answer.cost - motion.price, states=motion.states, controls=motion.controls, slopes=slopes,
        costates=motion.costates, free=free, values=values, grid=motion.grid, scheme=scheme, problem=problem,
        rung="polish", log=motion.answer.log, multipliers=None, accuracy=None,
    )  # fmt: skip


def _polished(
    problem: Problem, limits: tuple[StateLimit, ...], given: Solution, tried: _Try, scheme: Scheme,
    spent: tuple[int, float],
) -> Solution:  # fmt: skip
    motion, certificate = tried.motion, tried.certificate
    assert motion is not None
    assert certificate is not None
    iterations, seconds = spent
    found = _as_solution(problem, given, motion, scheme, _parameters(problem, given, motion))
    words = f"polished: {len(motion.arcs)} arcs, sign conditions open by {certificate.gap:.1e} of the cost"
    residual = float(np.max(found.error))
    if residual > RESIDUAL:
        words += f", local error of the dynamics {residual:.1e}"
    if motion.price > 0.0:
        words += f", singular arcs regularised at a price of {motion.price / abs(found.cost):.1e} of the cost"
    inside = motion.answer.derivatives
    timings = Timings(seconds - motion.answer.seconds, inside, motion.answer.seconds - inside, seconds)
    return replace(
        found, message=f"{Status.SOLVED.value}; {words}", iterations=iterations, timings=timings,
        structure=tabulate(problem, limits, motion.arcs),
    )  # fmt: skip


def _unpolished(solution: Solution, reason: str) -> Solution:
    return replace(solution, structure=None, message=f"{solution.message}; not polished: {reason}")
