"""What accuracy costs in simulation: error against seconds for forms and integrators, and which form is cheapest.

`measure` runs every integrator on every form in turn and returns a Table, `draw` its picture, `cheapest` the seconds
of the forms at equal error with one sentence. Errors are those of q and v, which all forms share.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

from models import Manipulator
from models.forms import canonical, hamel, lagrange
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from models.plots.style import saved
from ocp import Solution, System, integrators, simulate
from ocp.checks import Array
from ocp.integrators.contracts import Method

Control = Solution | Callable[[float], Array] | Sequence[float] | Array
FORMS = {"lagrange": lagrange, "hamel": hamel, "canonical": canonical}
TIMES = 8  # times, beside the end, at which errors are taken
LEVELS = (1e-3, 1e-5, 1e-7, 1e-9)  # errors at which forms are compared
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
STEP_COUNTS = tuple(2**k for k in range(5, 14))  # steps of fixed width over the horizon


@dataclass(frozen=True)
class Setting:
    """An integrator with its tolerance or step."""

    name: str
    value: float  # relative tolerance, or step [s]
    unit: str  # "" for a tolerance, "s" for a step
    method: Method


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    form: str
    method: str
    setting: float  # relative tolerance, or step [s]
    unit: str  # "" for a tolerance, "s" for a step
    error: float  # largest of q and v at all times, relative to the largest value of the component
    seconds: float  # median of the runs
    evaluations: int  # of f


@dataclass(frozen=True)
class Table:
    """Measured errors and seconds, with the error of the reference itself."""

    rows: tuple[Row, ...]
    reference_error: float  # largest difference between the references of the forms and of two tolerances


def settings(
    horizon: float, tolerances: Sequence[float] = TOLERANCES, step_counts: Sequence[int] = STEP_COUNTS
) -> tuple[Setting, ...]:
    """Return the ladder of all integrators with their tolerances and steps.

    Args:
        horizon: [s].
        tolerances: relative and absolute, of the integrators with error control.
        step_counts: numbers of steps over the horizon, of those without.
    """
    made: list[Setting] = []
    adaptive = (
        integrators.extrapolation, integrators.dormand_prince_5, integrators.dormand_prince_8, integrators.radau_5,
        integrators.adams, integrators.bdf,
    )  # fmt: skip
    for make in adaptive:
        made += [Setting(make.__name__, tol, "", make(tol, tol)) for tol in tolerances]
    fixed: dict[str, Callable[[float], Method]] = {
        "euler": integrators.euler,
        "heun": integrators.heun,
        "predictor_corrector(2)": integrators.predictor_corrector,
        "runge_kutta_4": integrators.runge_kutta_4,
        "gauss(2)": lambda step: integrators.gauss(2, step),
    }
    for name, of_step in fixed.items():
        made += [Setting(name, horizon / n, "s", of_step(horizon / n)) for n in step_counts]
    return tuple(made)


def forms(
    machine: Manipulator, effects: Sequence[Effect], q: Sequence[float] | Array, v: Sequence[float] | Array
) -> dict[str, tuple[System, Array]]:
    """Return every form of a machine in its regular frame with the state of q and v.

    Args:
        machine: a Manipulator.
        effects: such as [Gravity()].
        q, v: (n,) coordinates and velocities at t = 0.
    """
    basis = assemble(machine, effects).frame(None)
    w = basis.matrix @ machine.v
    results = {}
    for name, third in (("lagrange", machine.v), ("hamel", w), ("canonical", basis.metric @ w)):
        begin = ca.Function("begin", [machine.q, machine.v], [ca.densify(third)])
        results[name] = FORMS[name](machine, effects), np.concatenate([q, np.array(begin(q, v)).ravel()])
    return results


def measure(
    cases: Mapping[str, tuple[System, Array]],
    control: Control,
    horizon: float,
    ladder: Sequence[Setting] | None = None,
    *,
    breaks: Sequence[float] = (),
    repeats: int = 5,
    longest: float = 0.5,
) -> Table:
    """Return errors and median seconds of all settings on all forms, run in turn.

    Args:
        cases: name of a form -> system with the signals q and v, state at t = 0; all start at the same q, v.
        control: as for `simulate`.
        horizon: [s].
        ladder: integrators with their tolerances or steps; None is `settings(horizon)`.
        breaks: times where a control given as a function jumps [s].
        repeats: timed runs of each setting.
        longest: seconds of one run after which it is not repeated.

    Raises:
        RuntimeError: the reference of a form did not reach the end.
    """
    times = horizon * np.arange(1, TIMES + 1) / TIMES
    references: list[Array] = []
    rougher: list[Array] = []
    for name, (system, x0) in cases.items():
        for tol, kept in ((1e-13, references), (1e-12, rougher)):
            motion = simulate(system, x0, control, times, breaks=breaks, rtol=tol, atol=tol)
            if not motion.ok:
                raise RuntimeError(f"measure: no reference for the form {name}: {motion.message}")
            kept.append(np.hstack([motion.signal("q"), motion.signal("v")]))
    reference = np.mean(references, axis=0)
    largest = np.max(np.abs(reference), axis=0)
    size = np.where(largest > 0.0, largest, 1.0)
    own = max(float(np.max(np.abs(one - reference) / size)) for one in (*references, *rougher))
    seconds: dict[tuple[str, Setting], list[float]] = {}
    errors: dict[tuple[str, Setting], tuple[float, int]] = {}
    for setting in settings(horizon) if ladder is None else ladder:
        for turn in range(repeats + 1):
            for name, (system, x0) in cases.items():
                key = name, setting
                if turn > 1 and max(seconds[key]) > longest:
                    continue
                begun = time.perf_counter()
                motion = simulate(system, x0, control, times, breaks=breaks, method=setting.method)
                spent = time.perf_counter() - begun
                if turn == 0:  # the first run derives and compiles, as a user pays once for each system
                    far = np.abs(np.hstack([motion.signal("q"), motion.signal("v")]) - reference) / size
                    errors[key] = float(np.max(far)) if motion.ok else np.inf, motion.evaluations
                    seconds[key] = []
                else:
                    seconds[key].append(spent)
    rows = tuple(
        Row(name, s.name, s.value, s.unit, errors[name, s][0], float(np.median(runs)), errors[name, s][1])
        for (name, s), runs in seconds.items()
    )
    return Table(rows, own)


def front(rows: Sequence[Row]) -> list[Row]:
    """Return the Pareto front, from fast to accurate: no other row is both faster and more accurate."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (row.seconds, row.error)):
        if np.isfinite(row.error) and (not best or row.error < best[-1].error):
            best.append(row)
    return best


def seconds_at(rows: Sequence[Row], error: float) -> float:
    """Return the seconds for an error, interpolated on the Pareto front in logarithms; NaN outside of it."""
    line = front(rows)
    if not line or not line[-1].error <= error <= line[0].error:
        return line[0].seconds if line and error > line[0].error else float("nan")
    logs = np.log([[row.error, row.seconds] for row in reversed(line)])
    return float(np.exp(np.interp(np.log(error), logs[:, 0], logs[:, 1])))


def cheapest(table: Table, levels: Sequence[float] = LEVELS, method: str | None = None) -> tuple[Array, str]:
    """Return the seconds of every form at equal errors, (levels, forms), and one sentence on which form is cheapest.

    Args:
        table: from `measure`.
        levels: errors at which the forms are compared.
        method: of this integrator only; None takes the best one for each form and error.
    """
    names = list(dict.fromkeys(row.form for row in table.rows))
    chosen = [row for row in table.rows if method in (None, row.method)]
    seconds = np.array(
        [[seconds_at([r for r in chosen if r.form == name], level) for name in names] for level in levels]
    )
    known = np.all(np.isfinite(seconds), axis=1)
    if not np.any(known):
        return seconds, "no error level is reached by all forms"
    shares = np.median(seconds[known] / seconds[known].min(axis=1, keepdims=True), axis=0)
    best = int(np.argmin(shares))
    others = ", ".join(f"{name} {shares[k] / shares[best]:.2f}" for k, name in enumerate(names) if k != best)
    with_ = f"with {method}" if method else "with the best integrator for each"
    reached = ", ".join(f"{level:.0e}" for level in np.array(levels)[known])
    return seconds, f"cheapest to simulate {with_}: {names[best]}; times its seconds: {others} (errors {reached})"


def write_csv(table: Table, path: Path) -> None:
    """Write the table; the header has names and units."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["form", "method", "tolerance or step", "unit", "error", "seconds [s]", "evaluations"])
        for row in table.rows:
            writer.writerow([
                row.form, row.method, repr(row.setting), row.unit, repr(row.error), repr(row.seconds), row.evaluations,
            ])  # fmt: skip


def draw(table: Table, path: Path) -> None:
    """Draw error against seconds for every integrator, one small picture for each form, with the Pareto front."""
    names = list(dict.fromkeys(row.form for row in table.rows))
    methods = list(dict.fromkeys(row.method for row in table.rows))
    figure, axes = plt.subplots(
        1,
        len(names),
        figsize=(4.2 * len(names) + 1.6, 4.0),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for axis, name in zip(axes[0], names, strict=True):
        rows = [row for row in table.rows if row.form == name and np.isfinite(row.error) and row.error < 1.0]
        line = front(rows)
        axis.plot(
            [row.error for row in line], [row.seconds for row in line],
            color="#d0d4d8", linewidth=6, solid_capstyle="round", label="Pareto front", zorder=0,
        )  # fmt: skip
        for k, method in enumerate(methods):
            points = [(row.error, row.seconds) for row in rows if row.method == method]
            if points:
                fixed = any(row.unit for row in rows if row.method == method)
                axis.plot(*zip(*points, strict=True), "--s" if fixed else "-o", color=f"C{k % 10}" if k < 10 else "k",
                          markersize=3, linewidth=1.0, label=method)  # fmt: skip
        axis.axvline(
            table.reference_error, color="#888888", linewidth=0.8, linestyle=":", label="error of the reference"
        )
        axis.set(xscale="log", yscale="log", xlabel="error of q and v, share of the largest value", title=name)
        axis.invert_xaxis()
        axis.grid(visible=True, color="#e5e8eb", linewidth=0.6)
    axes[0][0].set_ylabel("seconds of one simulation")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8, frameon=False)
    saved(figure, path, dpi=130)
