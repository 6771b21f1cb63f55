"""What the command time_optimal prints about a motion: in words, and as plain data."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from models import Scene
from models.effects import Gravity
from models.mechanics.terms import name_of
from models.plots.signals import minimised, phases, problem_of
from ocp import Free, Report, SequenceSolution, Solution, estimate
from reports.motion_clearance import Clearances, lines_of, plain
from reports.motion_table import finite
from reports.verdict import Verdict

Files = dict[str, Path]


def named(scene: Scene) -> list[str]:
    """Return the names of the effects of a scene."""
    return [
        f"gravity {e.g:g} m/s^2" if isinstance(e, Gravity) and isinstance(e.g, float) else name_of(e)
        for e in scene.effects
    ]


def account(
    solution: Solution | SequenceSolution, report: Report, difference: float, verdict: Verdict, files: Files,
    clear: Clearances = (),
) -> dict[str, object]:  # fmt: skip
    """Return everything that the command prints as plain data."""
    figures = ("drift", "drift_end", "violation", "hamiltonian", "hamiltonian_value", "switching", "energy")
    legs = phases(solution)[0]
    return {
        "status": solution.status.name,
        "message": solution.message,
        "verified": verdict.ok,
        "verdict": str(verdict),
        "t_f": solution.duration,
        "iterations": solution.iterations,
        "elements": sum(len(leg.grid) for leg in legs),
        "legs": [leg.duration for leg in legs],
        **{name: finite(float(getattr(report, name))) for name in figures},
        "torque_difference": finite(difference),
        "clearances": plain(clear),
        "seconds": vars(solution.timings),
        "files": {kind: os.fspath(path) for kind, path in files.items()},
    }


MOVED = "grid moved"
SHOWN = 5  # least distances that are printed
NO_BALANCE = "no balance: the system has no signals energy and power"


def optimality(solution: Solution | SequenceSolution, report: Report) -> list[str]:
    """Return lines with the cost, if it is not the duration, and with its distance from this local optimum."""
    cost, words = problem_of(phases(solution)[0][0]).minimise, []
    timed = cost.time == 1.0 and cost.running.is_zero() and cost.final.is_zero() and cost.initial.is_zero()
    if not timed:
        words.append(f"cost         {solution.cost:.6g}, {minimised(solution)}")
    if not np.isfinite(report.switching) or MOVED in solution.message:
        # Limits that couple drives with speeds have no switching functions, a moved grid has errors of other kinds too.
        unit = " s" if timed else ""
        amount = f"{estimate(solution).cost:.1e}{unit}"
        return [*words, f"above opt.   about {amount} above this local optimum, by ocp.estimate"]
    amount = report.amounts.get("switching") or f"{100 * report.switching:.2g} % of the cost"
    return [*words, f"above opt.   about {amount} above this local optimum, by the switching functions (first order)"]


def hamiltonian(solution: Solution | SequenceSolution, report: Report) -> str:
    """Return the mean of the Hamiltonian, its deviation, and what an optimal motion has."""
    problem = problem_of(phases(solution)[0][0])
    free = isinstance(problem.horizon, Free)
    optimal = f"{-problem.minimise.time:g} is optimal" if free else "constant along an optimal motion"
    return f"{report.hamiltonian_value:.4f} in the mean ({optimal}), deviation {report.hamiltonian:.1e}"


def describe(
    show: Callable[[str], None], solution: Solution | SequenceSolution, report: Report, difference: float | str,
    verdict: Verdict, files: Files, clear: Clearances = (),
) -> None:  # fmt: skip
    """Print the compact account.

    Args:
        show: prints a line.
        solution: of any status.
        report: of `verify`.
        difference: of the recovered torques, share of the limit; or why they were not recovered.
        verdict: on the motion.
        files: written.
        clear: least distances of the links.
    """
    spent = solution.timings
    structure = solution.structure if isinstance(solution, Solution) else None
    digits = 6 if structure is None else 10
    show(f"verdict      {verdict}")
    status = solution.status.name.lower()
    show(f"t_f          {solution.duration:.{digits}f} s ({status}, {solution.iterations} iterations)")
    if "polished" in solution.message or MOVED in solution.message:
        show(f"polish       {solution.message.partition('; ')[2]}")
    for line in optimality(solution, report):
        show(line)
    if isinstance(solution, SequenceSolution):
        show(f"legs         {', '.join(f'{leg.duration:.6f}' for leg in solution.phases)} s")
    show(f"drift        {report.drift:.1e} of the range of its state, re-integrated at 1e-12")
    where = f" ({report.violation.what})" if report.violation > 0.0 else ""
    show(f"limits       exceeded by {report.violation:.1e} of their range between nodes{where}")
    for number, line in enumerate(lines_of(clear)[:SHOWN]):
        show(f"{'' if number else 'clearance':<13}{line}")
    show(f"Hamiltonian  {hamiltonian(solution, report)}")
    if structure is not None:
        show(f"structure\n{structure}")
    show(f"energy       {f'balance open by {report.energy:.1e}' if np.isfinite(report.energy) else NO_BALANCE}")
    if isinstance(difference, str):
        show(f"torques      those of the solution: {difference}")
    else:
        show(f"torques      recovered by Lagrange inverse dynamics, {difference:.1e} of the limit from the controls")
    show(f"seconds      set-up {spent.setup:.3f}, derivatives {spent.derivatives:.3f}, solver {spent.solver:.3f}")
    show(f"files        {', '.join(os.fspath(path) for path in files.values())}")
