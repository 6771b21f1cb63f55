"""What each effect of a scene costs in time, torque, energy and solver seconds, by solving without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models import Scene
from models.mechanics.terms import name_of
from models.plots.signals import phases
from models.scenes.task import Task
from ocp import Grid, SequenceSolution, Solution, Status, Timings, multistart, radau, solve, verify
from reports.motion_table import at_points, finite

GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(8)
TWO_OPTIMA = 1e-3  # relative difference of costs above which two solves have found two optima


@dataclass(frozen=True)
class Row:
    """One solve: the scene, or the scene without one of its effects."""

    name: str  # of the effect left out, "" for the whole scene
    status: Status | None  # None if the scene cannot be without the effect
    verified: bool
    message: str  # why there is no verified motion, or what else to know
    duration: float  # t_f [s]
    peak: tuple[float, ...]  # largest |tau| of every drive [N m or N]
    work: float  # that the drives deliver, integral of the sum of max(tau v, 0) [J]
    net: float  # delivered less taken back in braking, integral of tau . v [J]
    seconds: float  # of the solve from the default guess, set-up included
    iterations: int

    @property
    def ok(self) -> bool:
        """Whether the motion is solved and verified."""
        return self.verified


@dataclass(frozen=True)
class Budget:
    """The solve of a scene, and one without each of its effects."""

    drives: tuple[str, ...]  # name and unit of each drive's torque
    rows: tuple[Row, ...]  # the whole scene first
    motions: tuple[Solution | SequenceSolution | None, ...] = ()  # of the rows; None where there is none

    def plain(self) -> dict[str, object]:
        """Return the table as plain data."""

        def of(row: Row) -> dict[str, object]:
            status = row.status.name if row.status else "NOT POSSIBLE"
            values = {k: finite(v) if isinstance(v, float) else v for k, v in vars(row).items()}
            return {**values, "status": status, "peak": [finite(peak) for peak in row.peak]}

        return {"drives": self.drives, "rows": [of(row) for row in self.rows]}

    def __str__(self) -> str:
        whole = self.rows[0]
        heads = ["solved", "t_f [s]", "costs [s]", *(f"peak {name}" for name in self.drives)]
        heads += ["work [J]", "net [J]", "seconds", "rel."]
        lines, notes = [heads], []
        for row in self.rows:
            title = f"without {row.name}" if row.name else "whole scene"
            if row.message:
                notes.append(f"{title}: {row.message}")
            if row.status is None or not row.ok:
                failed = (
                    "not possible" if row.status is None else row.status.name.lower().replace("solved", "unverified")
                )
                lines.append([f"{title}: {failed}", *[""] * (len(heads) - 1)])
                continue
            cost = f"{whole.duration - row.duration:+.5f}" if row.name and whole.ok else ""
            lines.append([
                title, f"{row.duration:.5f}", cost, *(f"{peak:.4g}" for peak in row.peak),
                f"{row.work:.2f}", f"{row.net:.2f}", f"{row.seconds:.2f}", f"{row.seconds / whole.seconds:.2f}",
            ])  # fmt: skip
        widths = [max(len(line[k]) for line in lines if line[k] and (k == 0 or line[1])) for k in range(len(heads))]
        text = [
            "  ".join(
                cell.rjust(w) if k else cell.ljust(w) for k, (cell, w) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        ]
        foot = (
            "Every row is a solve of its own, of the scene that never heard of the effect; nothing is linearised.",
            "costs: t_f of the whole scene minus t_f without the effect; below the error of the grid it means nothing.",
            "work: what the drives deliver, braking not counted; net: braking counted as recovered. seconds: set-up",
            "and solve from the default guess.",
        )
        return "\n".join([*(line.rstrip() for line in text), *notes, *foot])


def effect_budget(
    scene: Scene, task: Task, grid: Grid, progress: Callable[[str], None] = lambda _: None, starts: int = 1
) -> Budget:
    """Return what each effect of a scene costs, by solving the task with each effect left out.

    A time-optimal problem has local optima: each scene is solved from the default guess, and, where the states are
    the same, from the motion of the whole scene too; the better one counts, and a note in the row shows if they differ.

    Args:
        scene: with its effects.
        task: of the scene; limits on signals of an effect are left out with the effect.
        grid: of every leg.
        progress: called with what is being solved.
        starts: of the search for local optima of every row.
    """
    labels = scene.system.label("tau", len(scene.machine.coordinates))
    progress("budget: the whole scene ...")
    whole, first = _row("", scene, task, (grid, starts), None)
    rows, motions = [whole], [first if whole.ok else None]
    for number, effect in enumerate(scene.effects, 1):
        name = name_of(effect)
        progress(f"budget: without {name} ({number} of {len(scene.effects)}) ...")
        motion = None
        try:
            bare = scene.without(effect)
            near = first if whole.ok else None
            row, motion = _row(name, bare, task.known_to(bare.system), (grid, starts), near)
        except (ValueError, KeyError) as error:
            nothing = (np.nan,) * len(labels)
            row = Row(name, None, False, str(error), np.nan, nothing, np.nan, np.nan, np.nan, 0)
        rows.append(row)
        motions.append(motion if row.ok else None)
    return Budget(tuple(map(str, labels)), tuple(rows), tuple(motions))


def _row(
    name: str, scene: Scene, task: Task, how: tuple[Grid, int], near: Solution | SequenceSolution | None
) -> tuple[Row, Solution | SequenceSolution]:
    problem, (grid, starts) = task.problem(scene.system), how
    cold = best = solve(problem, scheme=radau(3), grid=grid)
    message = ""
    if near is not None and _fits(near, scene):
        warm = solve(problem, scheme=radau(3), grid=grid, guess=near)
        if warm.ok and cold.ok and abs(warm.cost - cold.cost) > TWO_OPTIMA * abs(cold.cost):
            message = f"two local optima, {min(warm.cost, cold.cost):.6g} and {max(warm.cost, cold.cost):.6g}"
        if warm.ok and (not cold.ok or warm.cost < cold.cost):
            best = warm
    if starts > 1:
        optima = multistart(problem, starts, scheme=radau(3), grid=grid, first=best)
        best = optima[0].solution if optima else best
        message = optima.message.partition("; ")[2] if len(optima) > 1 else message
    report = verify(best)
    faults = report.failures if best.ok else (best.message,)
    peak, work, net = _effort(best, scene)
    timings: Timings = cold.timings
    row = Row(
        name, best.status, report.ok, "; ".join([message, *faults]).strip("; "), best.duration, peak, work, net,
        timings.total, best.iterations,
    )  # fmt: skip
    return row, best


def _fits(near: Solution | SequenceSolution, scene: Scene) -> bool:
    leg = phases(near)[0][0]
    return (leg.states.shape[2], leg.controls.shape[2]) == (scene.system.x.numel(), scene.system.u.numel())


def _effort(solution: Solution | SequenceSolution, scene: Scene) -> tuple[tuple[float, ...], float, float]:
    """Return the largest |tau| of every drive, the work that the drives deliver, and that less what they take back."""
    points = (GAUSS + 1.0) / 2.0
    ends = np.concatenate([[0.0], points, [1.0]])
    peak, work, net = np.zeros(len(scene.machine.coordinates)), 0.0, 0.0
    for leg in phases(solution)[0]:
        peak = np.maximum(peak, np.max(np.abs(at_points(leg, scene.system, "tau", ends)), axis=0))
        power = at_points(leg, scene.system, "tau", points) * at_points(leg, scene.system, "v", points)
        weights = (leg.duration * leg.grid.widths[:, None] * WEIGHTS / 2.0).ravel()
        work += float(weights @ np.sum(np.maximum(power, 0.0), axis=1))
        net += float(weights @ np.sum(power, axis=1))
    return tuple(map(float, peak)), work, net
