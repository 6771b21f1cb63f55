"""Random optimal-control tasks of the stability suite: each ends verified or with a reason in words."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from hard_cases.draws import KINDS, effects, parameters
from models import inverse_dynamics
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Grid,
    Ipopt,
    Problem,
    Report,
    Solution,
    Status,
    legendre,
    lobatto,
    point_to_point,
    prepare,
    radau,
    solve,
    uniform,
    verify,
)
from ocp.checks import Array
from ocp.solving.guess_rungs import Smooth, StraightLine
from ocp.transcription.schemes.scheme import Scheme

TASKS, REPORTED = 300, 50
FORMS = (lagrange, hamel, canonical)
SETTINGS = Ipopt(max_iter=120, max_seconds=10.0, progress=False)
LADDER = (Smooth(), StraightLine())
REFINEMENTS, UNRESOLVED = 2, "does not resolve"  # the words of `ocp.caveat`
LOCAL, PARTS = 1e-8, 4  # local error that a finer grid is made for, and the most parts of an element
LARGEST = 81  # ends of elements; a small grid shows more about the words than about the accuracy
REGULAR = ("regular", "ldl", "udu", "coordinate")


@dataclass(frozen=True, eq=False)
class Task:
    """One random task, and what it was drawn from in words."""

    problem: Problem
    scheme: Scheme
    grid: Grid
    words: str


class End(Enum):
    """What a task comes to."""

    VERIFIED = "solved and verified"
    DIAGNOSED = "not solved, and the message names a reason"
    WARNED = "solved, not verified, and the message of the solution says where it is wrong"
    DOUBTED = "solved, not verified, and only the verification says why"
    UNEXPLAINED = "an exception, a warning, no number, or no reason"


@dataclass(frozen=True)
class Verdict:
    """What came of a task, in words."""

    end: End
    words: str


def draw(seed: int) -> Task:
    """Return the random task of a seed.

    Machine, its parameters (ratios up to 1e3), effects, form, frame, ends, limits of torque between 0.9 and 30 times
    what is needed to hold the ends and to move in about a second, sometimes limits of position or speed, horizon and
    cost, scheme, shape of the control and grid.

    Args:
        seed: of everything.
    """
    random = np.random.default_rng([2026, seed])
    kind = str(random.choice(list(KINDS)))
    given = parameters(kind, random, random.uniform(0.0, 1.5))
    machine = KINDS[kind](**given)
    n = len(machine.coordinates)
    added = effects(random, n, 0.5, lagged=0.0) or [Gravity()]
    form = FORMS[random.integers(3)]
    frame = str(random.choice(REGULAR))
    lengths = np.array([1.0 if c.unit == "rad" else abs(given.get("l_T", 1.0)) for c in machine.coordinates])
    q0 = lengths * random.uniform(-1.2, 1.2, n)
    q1 = q0 if random.random() < 0.03 else q0 + lengths * random.normal(size=n) * 10.0 ** random.uniform(-3.0, 0.3)
    system = form(machine, added, frame)
    limit = _limits(machine, added, q0, q1, random)
    limits: dict[str, Array | tuple[Array, Array]] = {"command" if "command" in system.signals else "tau": limit}
    if random.random() < 0.5:
        room = np.abs(q1 - q0) * random.uniform(0.0, 1.0) + 1e-3 * lengths
        limits["q"] = (np.minimum(q0, q1) - room, np.maximum(q0, q1) + room)
    if random.random() < 0.3:
        limits["v"] = 10.0 ** random.uniform(-1.0, 1.0) * np.maximum(np.abs(q1 - q0), 1e-2 * lengths)
    duration = 10.0 ** random.uniform(-1.0, 1.0)
    effort = ca.sumsqr(system.u / np.maximum(limit, 1e-9))
    free = random.random() < 0.75
    horizon = Free(guess=duration) if free else Fixed(duration)
    share = float(random.choice([0.0, 0.0, 0.1]))
    cost = Bolza(time=1.0, running=share * effort) if free else Bolza(running=effort)
    problem = point_to_point(system, q0, q1, minimise=cost, horizon=horizon, limits=limits)
    control = (Control.COLLOCATED, *(Control.CONSTANT,) * 3, *(Control.LINEAR,) * 4)[random.integers(8)]
    maker, points = (radau, legendre, lobatto)[random.integers(3)], int(random.integers(3, 5))
    elements = int(random.integers(15, 21))
    grid = uniform(elements)
    if random.random() < 0.3:
        widths = random.uniform(0.5, 1.5, elements)
        grid = Grid(np.append(0.0, np.append(np.cumsum(widths)[:-1] / np.sum(widths), 1.0)))
    scheme = maker(points, control=control)
    names = ", ".join(type(effect).__name__ for effect in added)
    words = f"{kind}; {names}; {form.__name__}, {frame}; {type(horizon).__name__}; {scheme!r}, {elements}"
    return Task(problem, scheme, grid, words)


def _limits(machine: Manipulator, added: list[Effect], q0: Array, q1: Array, random: np.random.Generator) -> Array:
    """Return magnitudes (n,) of the drives: what holds the ends, and what moves each joint through its way in 1 s."""
    torques = inverse_dynamics(machine, added)
    n = len(q0)
    still = np.zeros(n)
    hold = [np.abs(np.array(torques(q, still, still, [])).ravel()) for q in (q0, (q0 + q1) / 2.0, q1)]
    way = 6.0 * np.maximum(np.abs(q1 - q0), 1e-3)
    moved = [np.abs(np.array(torques(q, still, way, [])).ravel()) for q in (q0, q1)]
    return np.asarray(np.max([*hold, *moved], axis=0) * 10.0 ** random.uniform(-0.05, 1.5) + 1e-6)


def judge(task: Task) -> Verdict:
    """Solve a task, on a finer grid if its own does not resolve the motion, and say what came of it.

    Args:
        task: as drawn.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning of a library says as little to a user as its exception
            solution, report = _solved(task)
    except Exception as error:
        return Verdict(End.UNEXPLAINED, f"{type(error).__name__}: {error}")
    reason = solution.message.partition(" (guesses tried")[0]  # which is no reason
    named = reason != solution.status.value
    if report is None:
        named = named or solution.status is Status.ACCEPTABLE  # that says what is wrong by itself
        return Verdict(End.DIAGNOSED if named else End.UNEXPLAINED, solution.message)
    numbers = (solution.duration, *solution.states.ravel(), *solution.controls.ravel())
    if not np.all(np.isfinite(numbers)):
        return Verdict(End.UNEXPLAINED, "solved, and not finite")
    if report.ok:
        return Verdict(End.VERIFIED, solution.message)
    words = f"{solution.message} | {'; '.join(report.failures)}"
    return Verdict(End.WARNED if named else End.DOUBTED, words)


def _solved(task: Task) -> tuple[Solution, Report | None]:
    """Return the solution, on a grid made finer where its error lies as long as it says that it is not resolved."""
    solution = solve(task.problem, task.scheme, task.grid, SETTINGS, guess=LADDER)
    for _ in range(REFINEMENTS):
        if not (solution.ok and UNRESOLVED in solution.message):
            break
        ends = solution.grid.ends
        parts = np.clip(np.ceil((solution.error / LOCAL) ** 0.25), 1.0, PARTS)
        pieces = [np.linspace(a, b, int(k) + 1)[1:] for a, b, k in zip(ends[:-1], ends[1:], parts, strict=True)]
        finer = np.concatenate([[0.0], *pieces])
        if len(finer) > LARGEST:
            break
        again = prepare(task.problem, task.scheme, Grid(finer), SETTINGS, guess=solution).proceed(solution)
        if not (isinstance(again, Solution) and again.ok):
            break
        solution = again
    return solution, verify(solution) if solution.ok else None


def every_task_ends_explained() -> Iterator[Figure]:
    """Yield after every 50 tasks how many of all so far are unexplained, none allowed, with the shares in words."""
    ends: Counter[End] = Counter()
    silent: list[str] = []
    for seed in range(TASKS):
        verdict = judge(draw(seed))
        ends[verdict.end] += 1
        if verdict.end is End.UNEXPLAINED:
            silent.append(f"task {seed}: {verdict.words}")
        if (seed + 1) % REPORTED == 0:
            shares = ", ".join(f"{100.0 * ends[end] / (seed + 1):.0f} % {end.name.lower()}" for end in End)
            note = "; ".join([f"{seed + 1} tasks: {shares}", *silent])
            yield Figure(float(ends[End.UNEXPLAINED]), 0.0, note=note)


CASES: tuple[Case, ...] = (
    Case("search", "optimal-control tasks", "tasks without an explanation", "", every_task_ends_explained, fast=False),
)
