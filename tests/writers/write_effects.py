"""Write docs/effects.md, what every effect adds and what it costs: python tests/writers/write_effects.py."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from statistics import median
from time import process_time

import casadi as ca

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from catalogue.machines import instructions

import models.effects as catalogue
from models import robots
from models.effects import (
    Coulomb,
    Counterbalance,
    ElasticDrive,
    GearEfficiency,
    Gravity,
    JointStop,
    LaggedDrive,
    MotionLimits,
    MotorDrive,
    Payload,
    PowerLimit,
    RotorInertia,
    Stribeck,
    ToolForce,
    TorqueRate,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.forms import canonical
from models.scenes.scene_template import TASKS
from ocp import Problem, Solution, point_to_point, prepare, uniform

PAGE = Path(__file__).resolve().parents[2] / "docs" / "effects.md"
RUNS, ELEMENTS = 3, 30
HEAD = """# Effects: what each adds, and what it costs

`python tests/writers/write_effects.py` writes this page. Each effect alone on the default machine, canonical form,
frame `regular`: the number of instructions of x' = f(x, u) with it (and how many more than without any effect), and the
OCP of `scripts/time_optimal.py` ({elements} elements of `radau(3)`) relative to the same one without effects: set-up /
solve, processor seconds, median of {runs} pairs of runs, and iterations. Ratios matter: an effect changes the optimal
motion, and with it the number of iterations. An effect that is not listed leaves no trace: the tests count
instructions, states, parameters and sparsity of every machine in every form.

| effect | what it is | states | control | signals | limits |
|---|---|---|---|---|---|
"""
MIDDLE = """
Signals that every machine has are not listed; `loss` [W] closes the balance of energy: power - loss = dE/dt.

| effect | {machines} |
|---|{rules}|
"""


ARMS = """
## Arms of links

Instructions of x' = f(x, u) in canonical form with each effect alone, and how many more than without any effect. Loads
become inertia of the last link: nothing more where that is a full one already, as for the Panda.

| effect | {arms} |
|---|{rules}|
"""


def cases(name: str) -> dict[str, list]:
    """Return every effect with parameters that suit a machine, and what they need beside them."""
    task = TASKS[name]
    return suited(task.limit, task.q_min, task.q_max)


def suited(limit: tuple[float, ...], q_min: tuple[float, ...], q_max: tuple[float, ...]) -> dict[str, list]:
    """Return every effect with parameters for drives and limits of positions."""
    light = tuple(0.02 * f for f in limit)
    motor = MotorDrive(tuple(f / 1000.0 for f in limit), 1.0, 1e-3, 100.0)
    return {
        "Gravity": [Gravity()],
        "Payload": [Payload(4.0)],
        "Payload (rigid, offset)": [Payload(4.0, (0.03, 0.02, 0.05), (0.03, 0.02, 0.04))],
        "Viscous": [Viscous(light)],
        "Coulomb": [Coulomb(light, 0.1)],
        "Stribeck": [Stribeck(light, tuple(1.5 * f for f in light), 0.5, 0.1)],
        "RotorInertia": [RotorInertia(1e-5, 100.0)],
        "RotorInertia, carried": [RotorInertia(1e-5, 100.0, carried=True)],
        "LaggedDrive": [LaggedDrive(0.02)],
        "ElasticDrive": [ElasticDrive(tuple(50.0 * f for f in limit), tuple(1e-3 * f for f in limit))],
        "GearEfficiency": [GearEfficiency(0.85)],
        "MotorDrive": [motor],
        "MotorDrive, L = 0": [MotorDrive(motor.constant, 1.0, 0.0, 100.0)],
        "WindingHeat (with MotorDrive)": [motor, WindingHeat(1.0, 100.0, 400.0)],
        "TorqueSpeed": [TorqueSpeed(tuple(1.6 * f for f in limit), 5.0)],
        "TorqueRate": [TorqueRate(tuple(50.0 * f for f in limit))],
        "MotionLimits": [MotionLimits(acceleration=20.0, tool_speed=2.0)],
        "PowerLimit": [PowerLimit(600.0)],
        "JointStop": [JointStop(q_min, q_max, tuple(100.0 * f for f in limit), 0.5, 0.01)],
        "ToolForce": [ToolForce((10.0, 0.0, -20.0))],
        "ToolForce of time": [ToolForce(lambda t: (10.0 * ca.sin(5.0 * t), 0.0, -20.0))],
        "Counterbalance": [Counterbalance(5.0, 500.0, (0.0, 0.0, -0.2), (0.0, 0.0, 0.5))],
    }  # fmt: skip


def stated(name: str, effects: list) -> Problem:
    """Return the task of a machine with effects."""
    task = TASKS[name]
    system = canonical(task.machine(), effects)
    control = {"command": "command", "voltage": "voltage", "motor_tau": "motor_tau"}
    signal = next((s for s in control if s in system.signals), "tau")
    limits = {signal: [100.0] * len(task.limit) if signal == "voltage" else task.limit}
    return point_to_point(system, task.q0, task.q1, q=(task.q_min, task.q_max), **limits)


def timed(problem: Problem) -> tuple[float, float, Solution]:
    """Return processor seconds of set-up and solve, and the solution."""
    begun = process_time()
    prepared = prepare(problem, grid=uniform(ELEMENTS))
    ready = process_time()
    solution = prepared()
    return ready - begun, process_time() - ready, solution


def account(name: str, effects: list) -> tuple[int, float, float, int, bool]:
    """Return instructions, set-up and solve relative to the task without effects, iterations, and whether it solved.

    Both tasks are solved in turn: what else runs on the computer touches both.
    """
    bare, task = stated(name, []), stated(name, effects)
    pairs = [(timed(bare), timed(task)) for _ in range(RUNS)]
    setup, solving = (median(own[k] / none[k] for none, own in pairs) for k in (0, 1))
    solution = pairs[0][1][2]
    return instructions(task.system), setup, solving, solution.iterations, solution.ok


def described(name: str) -> str:
    """Return the row of an effect in the table of what is added."""
    kind = getattr(catalogue, name)
    task = TASKS["spherical"]
    never = canonical(task.machine())
    key = next(k for k in cases("spherical") if k.startswith(name))
    system = canonical(task.machine(), cases("spherical")[key])
    first = inspect.getdoc(kind).splitlines()[0].rstrip(".").replace("|", "\\|")
    states = [label.name for label in system.labels["x"][never.x.numel() :]]
    control = [label.name for label in system.labels["u"]]
    # Of the effect itself: drives that it needs beside it are listed with them.
    beside = canonical(task.machine(), cases("spherical")["MotorDrive"]) if name == "WindingHeat" else never
    known = {label.name for label in beside.labels["x"]}
    states = [state for state in states if state not in known]
    more = [s for s in system.signals if s not in beside.signals and s not in states and s != "rest"]
    listed = ", ".join(f"`{state}`" for state in states[:2]) + (" ..." if len(states) > 2 else "")
    changed = control != [label.name for label in beside.labels["u"]]
    return (
        f"| `{name}` | {first} | {len(states) or ''} {listed} | {'`' + control[0] + '` ...' if changed else ''} | "
        f"{', '.join(f'`{s}`' for s in more)} | {', '.join(f'`{s}`' for s in system.limits)} |\n"
    )


def arms() -> str:
    """Return the table of instruction counts of arms."""
    made = [robots.arm_3r(), robots.ur5(), robots.panda()]
    bare = [instructions(canonical(arm)) for arm in made]
    text = ARMS.format(arms=" | ".join(arm.name for arm in made), rules="|".join(["---"] * len(made)))
    text += f"| none | {' | '.join(map(str, bare))} |\n"
    effects = [suited(arm.limits["tau"][1], *arm.limits["q"]) for arm in made]
    for case in effects[0]:
        counts = [instructions(canonical(arm, own[case])) for arm, own in zip(made, effects, strict=True)]
        cells = (f"{count} (+{count - none})" for count, none in zip(counts, bare, strict=True))
        text += f"| {case} | {' | '.join(cells)} |\n"
    return text


def main() -> None:
    """Measure and write."""
    text = HEAD.format(elements=ELEMENTS, runs=RUNS)
    text += "".join(described(name) for name in catalogue.__all__)
    none = {}
    for name in TASKS:
        timed(stated(name, []))  # the first one loads libraries
        none[name] = account(name, [])
    heads = " | ".join(f"{name}: instructions | set-up / solve, iterations" for name in TASKS)
    text += MIDDLE.format(machines=heads, rules="|".join(["---|---"] * len(TASKS)))
    cells = " | ".join(f"{count} | 1 / 1, {rounds}" for count, _, _, rounds, _ in none.values())
    text += f"| none | {cells} |\n"
    for case in cases("spherical"):
        row = []
        for name in TASKS:
            count, setup, solving, rounds, ok = account(name, cases(name)[case])
            ratio = f"{setup:.1f} / {solving:.1f}, {rounds}" + ("" if ok else " (not solved)")
            row.append(f"{count} (+{count - none[name][0]}) | {ratio}")
            print(name, case, row[-1], flush=True)
        text += f"| {case} | {' | '.join(row)} |\n"
    PAGE.write_text(text + arms(), encoding="utf-8")


if __name__ == "__main__":
    main()
