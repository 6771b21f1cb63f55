"""How the command time_optimal finds a motion: from one start or several, on one grid or to an accuracy."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields

from models.scenes.task import Task
from ocp import (
    Allowed,
    Cost,
    Seconds,
    SequenceSolution,
    Solution,
    System,
    gentlest,
    multistart,
    polish,
    radau,
    resolved,
    solve,
    solve_to_accuracy,
    uniform,
)
from ocp.problem.sequence import phases_of
from reports.output import working

TORQUES = "torques"
AGREEMENT = 1e-6  # of recovered torques with those of the solution, share of the limit
SECONDS = 60.0  # for --accuracy


@dataclass(frozen=True)
class Checks:
    """What counts as verified: the figures of `verify`, and the torques that are recovered from the motion.

    Args:
        allowed: figures of `verify`.
        torques: difference of recovered torques from those of the solution, share of the limit of the drive.
    """

    allowed: Allowed = field(default_factory=Allowed)
    torques: float = AGREEMENT


def add_solving(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a motion is found and what counts as verified."""
    parser.add_argument("--nodes", type=_count, metavar="N", help="elements of the grid (default: of the scene, 50)")
    parser.add_argument(
        "--starts", type=_count, default=1, metavar="N", help="starts of the search for local optima (default: 1)"
    )
    parser.add_argument(
        "--accuracy", type=_positive, metavar="E", help="refine until the error of the cost is E (of t_f: in s)"
    )
    parser.add_argument(
        "--polish", action="store_true", help="make the switching times unknowns; t_f to about nine digits"
    )
    parser.add_argument(
        "--gentle", action="store_true", help="let drives that the time leaves open move with the least effort"
    )
    names = ", ".join(f"{name}={value:g}" for name, value in _defaults().items())
    parser.add_argument(
        "--allow", nargs="+", default=[], metavar="NAME=SHARE", type=_share, help=f"what counts as verified ({names})"
    )


def checks_of(options: argparse.Namespace) -> Checks:
    """Return what counts as verified."""
    given = dict(options.allow)
    torques = given.pop(TORQUES, AGREEMENT)
    return Checks(Allowed(**given), torques)


def find(
    task: Task, system: System, options: argparse.Namespace, show: Callable[[str], None], shown: bool
) -> Solution | SequenceSolution:
    """Return the motion that the options ask for.

    Args:
        task: of the motion.
        system: of the scene.
        options: with those of `add_solving`.
        show: prints a line.
        shown: whether to show progress.
    """
    problem, scheme, grid = task.problem(system), radau(3), uniform(task.elements)
    with working("solving", shown, own_line=True):
        solution: Solution | SequenceSolution = solve(problem, scheme=scheme, grid=grid)
    if options.starts > 1:
        with working(f"solving from {options.starts - 1} more starts", shown, own_line=True):
            optima = multistart(problem, options.starts, scheme=scheme, grid=grid, first=solution)
        solution = optima[0].solution if optima else solution
        show(f"optima       {optima.message.partition('; ')[2] or optima.message}")
    if options.accuracy is not None:
        timed = all(one.minimise.time == 1.0 and one.minimise.running.is_zero() for one in phases_of(problem))
        wanted = Seconds(options.accuracy) if timed else Cost(options.accuracy)
        with working("refining", shown, own_line=True):
            steps = solve_to_accuracy(problem, wanted, scheme, grid, guess=solution, seconds=SECONDS)
            solution = list(steps)[-1]
        show(f"accuracy     {solution.message.rpartition(' (')[2].rstrip(')')}")
    elif options.nodes is None:
        with working("refining", shown, own_line=True):
            solution = resolved(solution)
    if options.polish:
        with working("polishing", shown, own_line=True):
            solution = polish(solution)  # type: ignore[type-var]  # either kind gives its own kind
    if options.gentle and solution.structure is None:  # a polished motion moves like that already
        with working("least effort", shown, own_line=True):
            solution = gentlest(solution)  # type: ignore[type-var]
    return solution


def _defaults() -> dict[str, float]:
    return {part.name: float(getattr(Allowed(), part.name)) for part in fields(Allowed)} | {TORQUES: AGREEMENT}


def _share(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    if name not in _defaults():
        raise argparse.ArgumentTypeError(f"got {text!r}, expected NAME=SHARE with one of {', '.join(_defaults())}")
    return name, _positive(value)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a number > 0")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 1")
    return value
