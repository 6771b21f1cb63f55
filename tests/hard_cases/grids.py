"""Extremes of grids and tolerances, singular arcs, and two optima of nearly the same time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from hard_cases.extremes import LEFT, MASS, POLISHED, WEIGHT, carriage, ended, exact, lift, shortest
from ocp import (
    Ball,
    Bolza,
    Fixed,
    Free,
    Grid,
    Guess,
    Ipopt,
    Problem,
    Solution,
    System,
    along,
    multistart,
    outside,
    point_to_point,
    polish,
    solve,
    start,
    uniform,
    verify,
)

FORCE = 900.0
SLOPES = (FORCE + WEIGHT) / (FORCE - WEIGHT)  # ratio of accelerations before and after the switch


def _sizes() -> Iterable[Figure]:
    """Grids of 1 to 5000 elements; one constant control cannot start and stop a mass."""
    task, load = point_to_point(carriage(), [0.0], [1.0], tau=1.0), lift(0.6, FORCE)
    for count in (1, 2, 3, 4, 10, 100):
        brief = Ipopt(max_iter=100)
        yield ended(solve(task, grid=uniform(count), solver=brief), count, 2.0)
        yield ended(solve(load, grid=uniform(count), solver=brief), count, shortest(0.6, FORCE, MASS, WEIGHT))
    for count in (2, 20, 200):
        yield from exact(solve(task, grid=uniform(count)), 2.0, LEFT * max(1.0, count / 20), count)


def _thousands() -> Iterable[Figure]:
    result = solve(point_to_point(carriage(), [0.0], [1.0], tau=1.0), grid=uniform(5000))
    yield from exact(result, 2.0, LEFT * 5000 / 20, 5000)
    result = solve(lift(0.6, FORCE), grid=uniform(5000))
    error = result.duration / shortest(0.6, FORCE, MASS, WEIGHT) - 1.0 if result.ok else np.nan
    yield Figure(error, LEFT * 5000 / 20 + SLOPES / 5000**2, 5000, note=result.message)


def crowded(point: float, share: float) -> Grid:
    """Return a grid of 50 elements, 30 of them within a share of the time, from a point on."""
    rest = 1.0 - share
    before = round(20 * point / rest)
    parts = [np.linspace(0.0, point, before + 1), np.linspace(point, point + share, 31)]
    return Grid(np.unique(np.append(np.concatenate([*parts, np.linspace(point + share, 1.0, 21 - before)]), 1.0)))


def _crowded() -> Iterable[Figure]:
    """60 % of the elements in 1 % of the time, and in far less."""
    for share in (1e-2, 1e-4, 1e-6, 1e-8):
        for point in (0.0, 0.3, 1.0 - share):
            grid = crowded(point, share)
            widest = float(np.max(grid.widths))
            result = solve(lift(0.6, FORCE), grid=grid)
            # A switch inside an element of width h costs less than h^2 of the time, times the ratio of accelerations.
            yield from exact(result, shortest(0.6, FORCE, MASS, WEIGHT), widest**2 * SLOPES, share)


def _tolerances() -> Iterable[Figure]:
    """The error of the duration follows the tolerance down to rounding."""
    task = point_to_point(carriage(), [0.0], [1.0], tau=1.0)
    for tol in (1e-6, 1e-8, 1e-10, 1e-12, 1e-13):
        result = solve(task, grid=uniform(20), solver=Ipopt(tol=tol))
        yield from exact(result, 2.0, 20 * 10 * tol + 1e3 * np.finfo(float).eps, tol)
    for tol in (1e-3, 1e-16, 1e-18):
        result = solve(task, grid=uniform(20), solver=Ipopt(tol=tol, max_iter=100))
        yield ended(result, tol, 2.0)
        named = result.ok or tol > 1e-13 or "below rounding" in result.message
        yield Figure(float(not named), 0.0, tol, note=result.message)


def _singular() -> Iterable[Figure]:
    """Least integral of x^2 with x' = u, |u| <= 1, x(0) = a, in 3 a: full speed, then u = 0, singular; a^3 / 3."""
    for away in 10.0 ** np.arange(-3.0, 4.0):
        x, u = ca.SX.sym("x"), ca.SX.sym("u")
        system = System(x, u, ca.SX(0, 1), u, {"q": x, "tau": u}, {})
        cost = Bolza(running=x**2)
        task = Problem(system, Fixed(3.0 * away), cost, (start(x, away), along(u, -1.0, 1.0)))
        for grid, tolerance in ((uniform(30), LEFT), (uniform(31), 3.0 / 31**2)):
            result = solve(task, grid=grid)
            report = verify(result)
            error = result.cost / (away**3 / 3.0) - 1.0 if report.ok else np.nan
            yield Figure(error, tolerance, away, note=f"{result.message} [{'; '.join(report.failures)}]")
        if round(np.log10(away)) % 3:
            continue
        # Polished, if that keeps the control within its limits between the points, or as it was.
        better = polish(solve(task, grid=uniform(31)))
        error = better.cost / (away**3 / 3.0) - 1.0
        yield Figure(error, POLISHED if better.structure is not None else 3.0 / 31**2, away, note=better.message)


def _chattering() -> Iterable[Figure]:
    """Fuller's problem has infinitely many switches in a finite time: verified to first order, or a reason."""
    for away in 10.0 ** np.arange(-3.0, 4.0):
        system = carriage()
        goal = Bolza(running=system["q"] ** 2)
        begin = start(system["q"], away), start(system["v"], 0.0)
        task = Problem(system, Fixed(5.0 * away**0.5), goal, (*begin, along(system["tau"], -1.0, 1.0)))
        yield ended(solve(task, grid=uniform(40)), away)


def passage(offset: float) -> Problem:
    """Return a mass in a plane that passes a ball with its centre off the straight way."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[2:], u), {"q": x[:2], "v": x[2:], "tau": u}, {})
    task = point_to_point(system, [-1.0, 0.0], [1.0, 0.0], tau=1.0, horizon=Free(4.0))
    ball = outside(Ball([0.0, offset, 0.0], 0.8), ca.vertcat(x[:2], 0))
    return replace(task, subject_to=(*task.subject_to, ball))


def _around(offset: float, side: float) -> Solution:
    share = np.linspace(0.0, 1.0, 21)
    bump = side * np.sin(np.pi * share) ** 2
    x = np.stack([2.0 * share - 1.0, bump, np.full(21, 0.5), 0.0 * share], axis=1)
    guess = Guess(share, x, np.zeros((21, 2)), 4.0, np.zeros(0))
    result: Solution = solve(passage(offset), grid=uniform(21), guess=guess)
    return result


def _two_ways() -> Iterable[Figure]:
    """Below a ball that lies a little higher is as far as above one that lies lower by as much, and the shorter way."""
    for offset in 10.0 ** -np.arange(1.0, 8.0):
        below, above, mirrored = _around(offset, -1.0), _around(offset, 1.0), _around(-offset, 1.0)
        apart = below.duration / mirrored.duration - 1.0 if below.ok and mirrored.ok else np.nan
        yield Figure(apart, 2.0 * LEFT, offset, note=f"{below.message}; {mirrored.message}")
        wrong = not (below.ok and above.ok and below.duration < above.duration)
        # Nearer than the tolerance of the solves nobody can tell them apart.
        yield Figure(float(wrong and offset > LEFT), 0.0, offset, note=f"{above.duration - below.duration:.2e} s apart")
        for result in (below, above):
            report = verify(result)
            yield Figure(float(not report.ok), 0.0, offset, note="; ".join(report.failures))


def _found() -> Iterable[Figure]:
    for offset in (1e-1, 1e-3, 1e-5, 1e-7):
        optima = multistart(passage(offset), 6, grid=uniform(21))
        sides = {float(np.sign(o.solution.signal("q", o.solution.duration / 2.0)[1])) for o in optima}
        costs = [o.solution.cost for o in optima]
        wrong = sides != {-1.0, 1.0} or costs != sorted(costs)
        yield Figure(
            float(wrong), 0.0, offset, note=f"{len(optima)} optima: {', '.join(f'{c:.9g}' for c in costs[:4])}"
        )


CASES: tuple[Case, ...] = (
    Case("grids", "1 to 200 elements", "t_f, relative, or named", "elements", _sizes, fast=False),
    Case("grids", "5000 elements", "t_f, relative", "elements", _thousands, fast=False),
    Case("grids", "60 % of the elements in a small share of the time", "t_f, relative", "share", _crowded, fast=False),
    Case("grids", "tolerances to rounding", "t_f, relative, or named", "tolerance", _tolerances),
    Case("extremes", "singular arc", "cost, relative", "size", _singular, fast=False),
    Case("extremes", "infinitely many switches", "verified or named", "size", _chattering),
    Case("extremes", "two optima of nearly the same time", "t_f, relative; order", "offset", _two_ways),
    Case("extremes", "search for two optima of nearly the same time", "both found", "offset", _found, fast=False),
)
