"""Motions of robots for the benchmark: with and without speed limits, load, friction, obstacle, and random ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from models import Manipulator, robots
from models.effects import Coulomb, Gravity, Payload, Viscous
from models.forms import canonical, inverse
from ocp import (
    Ball,
    Ipopt,
    Problem,
    Solution,
    System,
    gentle,
    outside,
    point_to_point,
    polish,
    solve,
    solve_to_accuracy,
    uniform,
    verify,
)

ELEMENTS = 50
TOLERANCE, SECONDS = 1e-3, 60.0  # of the refinement of random tasks [s], and its limit of wall-clock time [s]
FRICTION = 0.03, 0.01, 0.1  # Coulomb force and viscous force at 1 rad/s, shares of the effort; width [rad/s]
LOAD = 2.0  # [kg]
BALL = 0.25  # radius of the obstacle, share of the distance between the ends of the tool
SPAN = 2.0  # largest distance of random ends from the middle of the range of a joint [rad]
Pose = tuple[float, ...]
NAMED: dict[str, tuple[Callable[[], Manipulator], Pose, Pose]] = {
    "UR5": (robots.ur5, (0.0, -1.0, 1.0, 0.0, 0.5, 0.0), (1.0, -0.5, 0.5, 0.5, 0.0, 0.5)),
    "PUMA 560": (robots.puma560, (0.0,) * 6, (0.5,) * 6),
    "Panda": (robots.panda, (0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0), (1.0, 0.2, 0.5, -1.2, 0.4, 2.2, 0.6)),
    "Manutec r3": (robots.manutec_r3, (0.0, -1.5, 0.0), (1.0, -1.95, 1.0)),
}
VARIANTS = ("torque", "speed", "load", "friction", "obstacle")


@dataclass(frozen=True)
class ArmMotion:
    """A motion from rest to rest within the limits of the data sheet."""

    name: str
    make: Callable[[], Manipulator]
    begin: Sequence[float]
    finish: Sequence[float]
    variant: str = "speed"

    def problem(self, form: Callable[..., System] = canonical) -> Problem:
        """Return the time-optimal motion.

        Args:
            form: of the equations of motion.
        """
        machine = self.make()
        limits: Mapping[str, Any] = machine.limits
        effects: list[Any] = [Gravity()]
        if self.variant == "torque":
            limits = {name: ends for name, ends in limits.items() if name != "v"}
        if self.variant == "load":
            effects.append(Payload(LOAD))
        if self.variant == "friction":
            effort = np.array(machine.limits["tau"][1])
            dry, damping, width = FRICTION
            effects += [Viscous(tuple(damping * effort)), Coulomb(tuple(dry * effort), width)]
        arm = form(machine, effects)
        problem = point_to_point(arm, self.begin, self.finish, limits=limits)
        if self.variant != "obstacle":
            return problem
        tool = ca.Function("tool", [machine.q], [machine.tool])
        ends = [tool(list(pose)).full().ravel() for pose in (self.begin, self.finish)]
        middle = tool([(a + b) / 2 for a, b in zip(self.begin, self.finish, strict=True)]).full().ravel()
        ball = Ball(tuple(middle.tolist()), BALL * float(np.linalg.norm(ends[1] - ends[0])))
        return replace(problem, subject_to=(*problem.subject_to, outside(ball, arm["tool"])))


def named_motions() -> Iterator[ArmMotion]:
    """Yield the named motions, each in every variant that its data allow."""
    for name, (make, begin, finish) in NAMED.items():
        for variant in VARIANTS:
            if variant == "speed" and "v" not in make().limits:
                continue
            yield ArmMotion(f"{name}, {variant}", make, begin, finish, variant)


def random_motions(count: int, seed: int = 20261130) -> Iterator[ArmMotion]:
    """Yield random motions of UR5 and Panda, ends uniform within 80 % of the range of every joint, at most +-2 rad."""
    for k in range(count):
        for number, (name, make) in enumerate((("UR5", robots.ur5), ("Panda", robots.panda))):
            low, high = (np.array(ends) for ends in make().limits["q"])
            middle, half = (low + high) / 2.0, np.minimum(0.4 * (high - low), SPAN)
            rng = np.random.default_rng([seed, number, k])
            begin, finish = (middle + half * rng.uniform(-1.0, 1.0, len(low)) for _ in range(2))
            yield ArmMotion(f"{name} random {k:02d}", make, begin.tolist(), finish.tolist())


def run_named(motion: ArmMotion, seconds: float) -> dict[str, Any]:
    """Solve, verify and polish one motion; refine it, and solve it with accelerations as controls, if it drifts."""
    begun = time.process_time()
    problem = motion.problem()
    built = time.process_time()
    solution = solve(problem, grid=uniform(ELEMENTS), solver=Ipopt(progress=False))
    row: dict[str, Any] = {
        "form_s": built - begun, "solve_s": time.process_time() - built, "setup_s": solution.timings.setup,
        "derivatives_s": solution.timings.derivatives, "solver_s": solution.timings.solver,
        "iterations": solution.iterations, "status": solution.status.name, "t_f": float(solution.duration),
        "guess": solution.rung,
    }  # fmt: skip
    if not solution.ok:
        return _rounded(row | {"verified": False, "reason": solution.message})
    row |= {"verified": verify(solution).ok, **_polished(solution, seconds)}
    if not row["verified"]:
        row |= _with_accelerations(motion) | _refined(gentle(problem), None)[0]
    return _rounded(row)


def run_random(motion: ArmMotion, seconds: float) -> dict[str, Any]:
    """Solve one motion with `gentle`, refine it to an accuracy, verify and polish it; seconds of processor time."""
    begun = time.process_time()
    problem = gentle(motion.problem())
    solution = solve(problem, solver=Ipopt(progress=False))
    row: dict[str, Any] = {"solve_s": time.process_time() - begun, "iterations": solution.iterations}
    row |= {"status": solution.status.name, "t_f": float(solution.duration)}
    if not solution.ok:
        return _rounded(row | {"reason": solution.message})
    refined, last = _refined(problem, solution)
    row |= {"verified_first": verify(solution).ok, **refined}
    # What is polished is the motion of least time, without the cost on effort.
    exact = replace(last, problem=motion.problem(), cost=float(last.duration))
    return _rounded(row | _polished(exact, seconds))


def _with_accelerations(motion: ArmMotion) -> dict[str, Any]:
    """Solve and verify one motion with accelerations as controls."""
    begun = time.process_time()
    solution = solve(motion.problem(inverse), grid=uniform(ELEMENTS), solver=Ipopt(progress=False))
    row = {"inverse_s": time.process_time() - begun, "inverse_iterations": solution.iterations}
    return row | {"t_inverse": float(solution.duration), "inverse_verified": solution.ok and verify(solution).ok}


def _refined(problem: Problem, solution: Solution | None) -> tuple[dict[str, Any], Solution]:
    """Refine a motion with `gentle`, from 50 elements or from a solution, and verify it."""
    begun, quiet = time.process_time(), Ipopt(progress=False)
    row: dict[str, Any] = {}
    if solution is None:
        solution = solve(problem, grid=uniform(ELEMENTS), solver=quiet)
        row = {"gentle_s": time.process_time() - begun, "gentle_iterations": solution.iterations}
    if not solution.ok:
        return row | {"refined": False, "failures": solution.message}, solution
    begun = time.process_time()
    *_, last = solve_to_accuracy(problem, TOLERANCE, None, solution.grid, quiet, solution, seconds=SECONDS)
    row |= {"refine_s": time.process_time() - begun, "t_refined": float(last.duration), "elements": len(last.grid)}
    row |= {"t_error": float(last.accuracy.error), "reason_refined": last.accuracy.reason}
    report = verify(last)
    return row | {"refined": last.ok and report.ok, "failures": "; ".join(report.failures)}, last


def _polished(solution: Solution, seconds: float) -> dict[str, Any]:
    begun = time.process_time()
    result = polish(solution, seconds=seconds)
    arcs = len(result.structure) if result.structure is not None else 0
    row = {"polish_s": time.process_time() - begun, "arcs": arcs, "t_polished": float(result.duration)}
    return row | {"polish_verified": verify(result).ok, "reason": result.message}


def _rounded(row: dict[str, Any]) -> dict[str, Any]:
    return {key: round(value, 9 if key.startswith("t_") else 3) if isinstance(value, float) else value
            for key, value in row.items()}  # fmt: skip


def tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return both tables in Markdown."""
    lines = [
        "| motion | t_f, s | iterations | seconds: form, solve | verified | `gentle`, refined | `inverse` | polished |",
        "|---|---:|---:|---|---|---|---|---|",
    ]
    for row in (row for row in rows if " random " not in row["name"]):
        seconds = f"{row['form_s']:.2f}, {row['solve_s']:.2f}"
        polished = f"{row['t_polished']:.7f} ({row['polish_s']:.0f} s)" if row.get("arcs") else "no"
        yes = "yes" if row["verified"] else "no"
        refined, accelerations = "", ""
        if "refined" in row:
            refined = f"{row['t_refined']:.6f}, {'yes' if row['refined'] else 'no'}" if "t_refined" in row else "no"
        if "t_inverse" in row:
            own = "yes" if row["inverse_verified"] else "no"
            accelerations = f"{row['t_inverse']:.6f} ({row['inverse_iterations']}), {own}"
        lines.append(
            f"| {row['name']} | {row['t_f']:.6f} | {row['iterations']} | {seconds} | {yes} | {refined} | "
            f"{accelerations} | {polished} |"
        )
    lines += ["", "| robot | tasks | solved | verified, first grid | verified, refined | polished | median s: solve, "
              "refine, polish |", "|---|---:|---:|---:|---:|---:|---|"]  # fmt: skip
    for robot in ("UR5", "Panda"):
        own_rows = [row for row in rows if row["name"].startswith(f"{robot} random ")]
        solved = [row for row in own_rows if row["status"] == "SOLVED"]
        if not solved:
            continue
        counts = (sum(bool(row.get(key)) for row in solved) for key in ("verified_first", "refined", "arcs"))
        medians = (float(np.median([row[key] for row in solved])) for key in ("solve_s", "refine_s", "polish_s"))
        lines.append(
            f"| {robot} | {len(own_rows)} | {len(solved)} | {' | '.join(map(str, counts))} | "
            f"{', '.join(f'{value:.1f}' for value in medians)} |"
        )
    return "\n".join(lines)
