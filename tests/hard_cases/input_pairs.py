"""Bad input that fits each argument alone: parts of different sizes, of different systems, of different machines."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import casadi as ca

import ocp
from hard_cases import input_examples as example
from hard_cases import input_models
from hard_cases.input_call import BAD, Fault, fault, sentence
from models import Motion, forms, inverse_dynamics, recover, spherical
from models.effects import ElasticDrive, Gravity, ToolForce, WindingHeat

Attempt = tuple[str, Callable[[], object], tuple[str, ...]]  # what, the attempt, words that name the argument


@cache
def _small() -> ocp.Problem:
    """Return a problem of another system, a mass on a line."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    line = ocp.System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u), {"q": x[0], "v": x[1], "u": u})
    return ocp.point_to_point(line, [0.0], [1.0], u=1.0)


@cache
def _bare() -> ocp.Solution:
    """Return a solution without its model."""
    return dataclasses.replace(example.solution(), problem=None)


def effects() -> Iterator[Attempt]:
    """Yield effects whose lists do not fit the machine: of another length, or None where there must be a value."""
    long = BAD["long"]
    for call in input_models.acting():
        for name, argument in call.arguments.items():
            base = {key: one.valid for key, one in call.arguments.items()}
            for bad, value in (("17 values", long), ("three times None", [None] * 3)):
                if ("long" if value is long else "nones") in argument.fits:
                    made = partial(call.function, **(base | {name: value}))
                    yield f"{call.name}({name} = {bad})", partial(_on_machine, made), (name,)


def _on_machine(make: Callable[..., Any]) -> object:
    made = make()
    more = [] if not isinstance(made, WindingHeat) else [_motors()]
    return forms.canonical(example.machine(), [*more, made])


def _motors() -> Any:
    from models.effects import MotorDrive

    return MotorDrive(0.1, 1.0)


def parts() -> Iterator[Attempt]:
    """Yield parts that do not belong together."""
    bad: Any = partial  # what is given here has the wrong type on purpose
    problem, solution, small, arm = example.problem(), example.solution(), _small(), example.system()
    rest = {"system": arm, "x0": [0.0] * 6, "times": 0.1}
    grid = ocp.uniform(4)
    for name, function in (("verify", ocp.verify), ("estimate", ocp.estimate), ("polish", ocp.polish)):
        yield f"{name} with another problem", bad(function, solution, small), ("problem",)
        yield f"{name} without a problem", bad(function, _bare()), ("problem",)
    yield "solve from another system", bad(ocp.solve, small, guess=solution), ("guess",)
    yield "solve a sequence from one guess", bad(ocp.solve, example.sequence(), guess=solution), ("guess",)
    for extra in ({"no such": 1}, {"mu_strategy": 3}, {"max_iter": "many"}, {3: 4}, {"tol": None}, {"tol": [1.0]}):
        options = bad(ocp.Ipopt, progress=False, extra=extra)
        yield f"options {extra}", bad(_solved, problem, grid, options), ("extra",)
    yield "prepared for another problem", bad(example.prepared(), problem=small), ("problem",)
    yield "prepared for a sequence", bad(example.prepared(), problem=example.sequence()), ("problem",)
    yield "prepared on another grid", bad(example.prepared(), grid=ocp.uniform(9)), ("grid",)
    yield "no such parameter on a path", bad(
        ocp.solve, problem, grid=grid, guess=(ocp.ParameterPath("no such"),)), ("parameter",)  # fmt: skip
    for what, value in (("None", None), ("a text", "full"), ("two numbers", [1.0, 2.0]), ("NaN", [math.nan] * 3)):
        control = bad(_constant, value)
        yield f"a control that returns {what}", bad(ocp.simulate, **rest, control=control), ("control",)
    late = bad(_turns, [math.nan] * 3)
    yield (
        "a control that returns NaN later",
        bad(_reached, bad(ocp.simulate, **rest, control=late)),
        ("control", "f"),
    )
    wrong = bad(_turns, [1.0])
    yield "a control of another size later", bad(ocp.simulate, **rest, control=wrong), ("control",)
    yield "a signal without a model", bad(_bare().signal, "q", 0.0), ("signal",)
    yield "an error without a model", lambda: _bare().error, ("error",)
    yield "a tolerance on a control", bad(_parts, ocp.Signal("tau", 1e-3)), ("Signal",)
    yield "a tolerance on nothing", bad(_parts, ocp.Signal("no such", 1e-3)), ("signal",)
    yield "problems without links", bad(ocp.Sequence, (problem, small)), ("Sequence", "link")
    yield "a motion of another system", bad(Motion.of, solution, small.system), ("solution",)
    yield "a motion of no system", bad(Motion.of, _bare()), ("solution",)
    yield (
        "torques of another machine",
        bad(Motion.quintic([0.0], [1.0], 1.0).torques, example.machine()),
        ("motion",),
    )
    yield "drives without a tension", bad(_damped), ("drive_dynamics",)
    yield "recovered from another machine", bad(recover, arm, spherical(), [Gravity()]), ("system", "machine")
    yield (
        "an effect that returns None",
        bad(inverse_dynamics, example.machine(), [lambda machine, terms: None]),
        ("effects",),
    )
    force = bad(ToolForce, lambda t: "up")()
    yield "a force that is a text", bad(forms.canonical, example.machine(), [force]), ("force",)
    yield "a region of another dimension", bad(ocp.inside, ocp.Ball([0.0, 0.0], 1.0), arm["tool"]), ("Ball",)
    yield "a problem with a foreign symbol", bad(
        ocp.Problem, arm, subject_to=ocp.along(ca.SX.sym("y"), 0.0)), ("along",)  # fmt: skip
    yield "an expression without components", bad(ocp.along, ca.SX(0, 1), 0.0), ("along", "expression")
    yield "a scheme without controls between", bad(ocp.polish, solution, scheme=ocp.radau(3)), ("scheme",)
    polished, cart = example.polished(), example.cart()
    carried = ocp.prepare_structure(polished)
    yield "sensitivity with another problem", bad(ocp.sensitivity, polished, problem=problem), ("problem",)
    yield "sensitivity without a problem", bad(ocp.sensitivity, _bare()), ("problem",)
    yield "sensitivity by nothing", bad(ocp.sensitivity, polished, []), ("names",)
    yield "sensitivity by one number twice", bad(ocp.sensitivity, polished, ["m", "m"]), ("names",)
    yield "sensitivity of a problem", bad(ocp.sensitivity, problem), ("solution",)
    several = example.sequence_solution()
    yield "sensitivity of phases toward a problem", bad(ocp.sensitivity, several, toward={"b": problem}), ("toward",)
    yield "error of phases with one problem", bad(ocp.estimate, several, problem), ("problem",)
    yield "polishing of phases with one problem", bad(ocp.polish, several, problem), ("problem",)
    yield "sensitivity toward another problem", bad(ocp.sensitivity, polished, toward={"b": problem}), ("problem",)
    yield "sensitivity toward nothing", bad(ocp.sensitivity, polished, toward={"b": None}), ("toward",)
    yield "switches without a structure", bad(ocp.sensitivity(solution).switches, "tau"), ("switches",)
    yield "a structure without a structure", bad(ocp.prepare_structure, solution), ("prepare_structure",)
    yield "a structure for another problem", bad(carried, problem=problem), ("problem",)
    yield "a structure from another guess", bad(carried, guess=solution), ("guess",)
    yield "a design without cases", bad(_designed, []), ("cases",)
    yield "a design of other names", bad(_designed, [{"m": 1.0}, {"k": 1.0}]), ("cases",)
    for measured in (None, 3.0, {"q": "low"}, {"q": [1.0, 2.0]}, {"q": None, "v": 1j}):
        run = bad(_measured, cart, measured)
        yield f"a measure that returns {measured}", run, ("measure",)
    yield "a file of another problem", bad(_reloaded, small), ("problem",)


def _solved(problem: ocp.Problem, grid: ocp.Grid, settings: Callable[[], ocp.Ipopt]) -> object:
    return ocp.solve(problem, grid=grid, solver=settings())


def _constant(value: object, t: float) -> object:
    return value


def _turns(value: list[float], t: float) -> list[float]:
    return [0.0, 0.0, 0.0] if t < 0.05 else value


def _reached(run: Callable[[], ocp.Trajectory]) -> object:
    result = run()
    if not result.ok:
        raise ValueError(result.message)  # given by value, as an integration fails
    return result


class _Given:
    """A design of the user's own."""

    def __init__(self, rows: Any) -> None:
        self.rows = rows

    def cases(self) -> Any:
        """Return the cases."""
        return self.rows


def _designed(rows: Any) -> object:
    return ocp.Study(example.cart(), over=_Given(rows)).run()


def _measured(problem: ocp.Problem, value: Any) -> object:
    study = ocp.Study(problem, over={"m": [1.0]}, grid=ocp.uniform(4), measure=lambda solution: value)
    for message in study.run().failures.values():
        raise ValueError(message)  # given by value, as a case fails
    return None


def _parts(tolerance: ocp.Tolerance) -> object:
    solution = example.solution()
    return tolerance.parts(solution, ocp.estimate(solution))


def _damped() -> object:
    from models import drive_dynamics

    return drive_dynamics(example.machine(), [ElasticDrive(1e4, 1.0, damping=3.0)])


def _reloaded(problem: ocp.Problem) -> object:
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one.npz"
        ocp.save(example.solution(), path)
        return ocp.load(path, problem)


def refusals() -> Iterator[tuple[str, str, Fault | None]]:
    """Yield kind, attempt and what is wrong with its error, None where nothing is or where none is needed."""
    for what, attempt, names in effects():
        try:
            attempt()  # a list may fit this machine, or None may mean none
        except (ValueError, TypeError, KeyError) as error:
            wrong = sentence(error, names)
            yield "effects", what, Fault("effects", what, "", wrong) if wrong else None
        except BaseException as error:
            yield "effects", what, Fault("effects", what, "", f"{type(error).__name__}: {error}"[:300])
    for what, attempt, names in parts():
        wrong = fault(attempt, names)
        yield "parts", what, Fault("parts", what, "", wrong) if wrong else None
