"""The simulation half of the accuracy bill: integrators against each other on the forms of a machine."""

from __future__ import annotations

import argparse
import csv
import io
from dataclasses import astuple, fields

from accuracy_bill import simulation
from accuracy_bill.pareto_front import Curve, Point, recommend
from accuracy_bill.scene import Motion
from accuracy_bill.simulation import Row, Table
from models.effects import Gravity

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
STEPS = (32, 128, 512, 2048)
NAMES = tuple(dict.fromkeys(setting.name for setting in simulation.settings(1.0)))
WHAT = "q and v, share of their largest value"


def table(motion: Motion, options: argparse.Namespace) -> Table:
    """Return errors and seconds of the integrators on every form."""
    every = simulation.forms(motion.machine, [Gravity()], motion.q0, 0.0 * motion.q0)
    cases = {name: case for name, case in every.items() if name in (options.forms or every)}
    ladder = simulation.settings(motion.horizon, options.tolerances, options.steps)
    chosen = [setting for setting in ladder if setting.name in (options.integrators or NAMES)]
    return simulation.measure(cases, motion.drive(), motion.horizon, chosen, repeats=options.repeats, longest=0.1)


def curves(result: Table, form: str) -> list[Curve]:
    """Return the curve of every integrator on a form; errors below that of the reference count as that."""
    made = []
    for name in dict.fromkeys(row.method for row in result.rows):
        rows = [row for row in result.rows if (row.form, row.method) == (form, name)]
        points = [Point(_setting(row), max(row.error, result.reference_error), row.seconds) for row in rows]
        made.append(Curve(name, tuple(points), continuous=True))
    return made


def half(result: Table) -> tuple[list[Curve], float, str, str, str]:
    """Return what the picture shows: curves, error of the reference, heading, labels."""
    form = shown(result)
    heading = f"simulation, {form} form; reference accurate to {result.reference_error:.0e}"
    return (
        curves(result, form),
        result.reference_error,
        heading,
        f"error in {WHAT}",
        "seconds of one simulation, without the first",
    )


def words(result: Table, options: argparse.Namespace) -> str:
    """Return a recommendation, and which form is cheapest at equal error."""
    form = shown(result)
    advice = recommend(curves(result, form), options.tolerance, "", f"{WHAT} ({form} form)")
    _, sentence = simulation.cheapest(result)
    return f"Reference accurate to {result.reference_error:.1e}. {advice} {sentence[:1].upper()}{sentence[1:]}."


def shown(result: Table) -> str:
    """Return the form that is drawn: canonical if it took part."""
    names = [row.form for row in result.rows]
    return "canonical" if "canonical" in names else names[0]


def as_csv(result: Table) -> str:
    """Return all rows with every digit."""
    text = io.StringIO()
    writer = csv.writer(text)
    units = {"seconds": " [s]", "error": " [share]"}
    writer.writerow([f"{field.name}{units.get(field.name, '')}" for field in fields(Row)])
    writer.writerows([repr(v) if isinstance(v, float) else v for v in astuple(row)] for row in result.rows)
    return text.getvalue()


def _setting(row: Row) -> str:
    return f"step {row.setting:.2g} s" if row.unit else f"tolerance {row.setting:.0e}"
