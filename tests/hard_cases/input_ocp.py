"""Valid calls of what states and solves a problem, and what fits their arguments."""

from __future__ import annotations

import casadi as ca
import numpy as np

import ocp
import ocp.solution.storage
import ocp.solution.structure
from hard_cases import input_examples as example
from hard_cases.input_call import (
    ANY_TEXT,
    AT_LEAST_ZERO,
    BOUND,
    LIMIT,
    LIST,
    MAP,
    NOTHING,
    OPTIONAL,
    POSITIVE,
    REAL,
    TRUTH,
    Argument,
    Call,
)  # fmt: skip
from ocp import Control, Fixed, integrators
from ocp.problem.constraints import Where
from ocp.solving.nlp_solver import Start

A = Argument
NAN_LATER = frozenset({"table"})  # a guess with NaN is reported by the solve, which fails by value


def systems() -> tuple[Call, ...]:
    """Return the calls of systems, constraints, horizons, costs and problems."""
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
    rate = ca.vertcat(x[1], u + p)
    arm, problem = example.system(), example.problem()
    constraint = ocp.along(arm["q"], -1.0, 1.0)
    spoken = {name: A(value) for name, value in (("x", x), ("rate", rate))}
    spoken |= {
        name: A(value, frozenset({"symbol"})) for name, value in (("u", u), ("p", p))
    }  # named like those of rate
    ends = {
        "expression": A(arm["q"], frozenset({"symbol"})), "lower": A([0.0, 0.0, 0.0], LIMIT - {"inf", "infs"}),
        "upper": A([1.0, 1.0, 1.0], LIMIT - {"negative", "minus_inf"}), "name": A("here", ANY_TEXT),
    }  # fmt: skip
    return (
        Call("ocp.System", ocp.System, {
            **spoken, "signals": A({"x1": x[0]}, MAP - OPTIONAL, ("signal",)),
            "nominal": A({"p": 1.0}, frozenset({"names"})),
            "labels": A({}, frozenset({"map"})), "notes": A((), LIST | {"words"}), "limits": A({}, frozenset({"map"})),
            "initial": A({}, frozenset({"map"})), "singular": A((), LIST), "implicit": A(None, OPTIONAL),
            "t": A(None, OPTIONAL | {"symbol"}), "integrals": A(0, frozenset({"zero"})),
        }),
        Call("System.short", arm.short, {"expression": A(arm["q"], frozenset({"symbol"}))}),
        Call("System.label", arm.label, {"name": A("q", ANY_TEXT), "size": A(3, frozenset({"zero"}))}),
        Call("System.values", arm.values, {"given": A({"gravity.g": 9.0}, MAP, ("parameter",))}),
        Call("System.check_symbols", arm.check_symbols, {"expression": A(arm["q"], NOTHING, ("it",)),
            "what": A("it", ANY_TEXT)}),
        Call("ocp.Label", ocp.Label, {"name": A("q", ANY_TEXT), "unit": A("m", ANY_TEXT)}),
        Call("ocp.Fixed", ocp.Fixed, {"duration": A(1.0, POSITIVE)}),
        Call("ocp.Free", ocp.Free, {
            "guess": A(1.0, POSITIVE), "lower": A(0.0, AT_LEAST_ZERO), "upper": A(9.0, BOUND | {"zero"})}),
        Call("ocp.Bolza", ocp.Bolza, {
            "time": A(1.0, REAL), "running": A(x[0], REAL | {"symbol"}), "final": A(x[1], REAL | {"symbol"}),
            "initial": A(x[1], REAL | {"symbol"})}),
        Call("ocp.Problem", ocp.Problem, {
            "system": A(arm), "horizon": A(Fixed(1.0)), "minimise": A(ocp.Bolza(1.0)),
            "subject_to": A((constraint,), LIST)}),
        Call("Problem.labels", problem.labels, {"constraint": A(problem.subject_to[0])}),
        Call("Problem.limits", problem.limits, {
            "where": A(Where.ALONG), "symbols": A(arm.u, frozenset({"symbol"}))}),
        Call("ocp.start", ocp.start, ends),
        Call("ocp.end", ocp.end, ends),
        Call("ocp.along", ocp.along, {**ends, "between": A(1e-3, POSITIVE | OPTIONAL)}),
        Call("ocp.integral", ocp.integral, ends),
        Call("ocp.absolute", ocp.absolute, {
            "system": A(arm), "expression": A(arm["q"], NOTHING, ("absolute",)), "name": A("absolute", ANY_TEXT)}),
        Call("ocp.positive_part", ocp.positive_part, {
            "system": A(arm), "expression": A(arm["q"], NOTHING, ("positive_part",)),
            "name": A("positive_part", ANY_TEXT)}),
        Call("ocp.periodic", ocp.periodic, {"expression": ends["expression"], "shift": A(0.0, REAL | {"falling"})}),
        Call("ocp.extend", ocp.extend, {"system": A(arm)}),
        Call("ocp.time_derivative", ocp.time_derivative, {"system": A(arm),
            "expression": A(arm["q"], NOTHING, ("time_derivative",))}),
        Call("ocp.Sequence", ocp.Sequence, {
            "problems": A((problem, problem), NOTHING, ("Sequence",)), "links": A(("q", "v"), LIST, ("signal",)),
            "closing": A((), LIST | {"empty"}, ("signal",))}),
        Call("ocp.point_to_point", ocp.point_to_point, {
            "system": A(arm), "q0": A(example.Q0, REAL | {"falling"}),
            "q1": A(example.Q1, REAL | {"falling"}), "minimise": A(ocp.Bolza(1.0)),
            "horizon": A(Fixed(1.0), OPTIONAL), "limits": A({"v": 3.0}, OPTIONAL | {"map"}, ("no such",)),
            "tau": A([9.0, 9.0, 9.0], AT_LEAST_ZERO | {"none", "inf", "infs", "falling"})}),
    )  # fmt: skip


def regions() -> tuple[Call, ...]:
    """Return the calls of regions of space."""
    tool = example.system()["tool"]
    ball, box = ocp.Ball([0.0, 0.0, 1.0], 0.2), ocp.Box([0.0, 0.0, 0.0], [1.0, 1.0, 1.0])
    post, wall = ocp.Cylinder([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.1), ocp.HalfSpace([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    point, many = A([0.0, 0.0, 0.0]), frozenset({"long", "falling"})  # regions may lie in any space
    inside = tuple(
        Call(f"{type(region).__name__}.within", region.within, {"point": A(tool)}) for region in (ball, box, post, wall)
    )
    return (
        Call("ocp.Ball", ocp.Ball, {"centre": A(point.valid, many), "radius": A(0.2, POSITIVE)}),
        Call("ocp.Box", ocp.Box, {"lower": A(point.valid, frozenset({"falling"})), "upper": A([9.0, 9.0, 9.0])}),
        Call("ocp.Cylinder", ocp.Cylinder, {
            "centre": A(point.valid, frozenset({"falling"})), "axis": A([0.0, 0.0, 1.0], frozenset({"falling"})),
            "radius": A(0.1, POSITIVE), "length": A(1.0, BOUND)}),
        Call("ocp.HalfSpace", ocp.HalfSpace, {
            "point": A(point.valid, frozenset({"falling"}), ("normal",)),
            "normal": A([0.0, 0.0, 1.0], frozenset({"falling"}))}),
        Call("ocp.inside", ocp.inside, {"region": A(ball), "point": A(tool)}),
        Call("ocp.outside", ocp.outside, {"region": A(box), "point": A(tool)}),
        *inside,
    )  # fmt: skip


def grids() -> tuple[Call, ...]:
    """Return the calls of grids, schemes, guesses, settings and tolerances."""
    grid, guess, scheme = ocp.uniform(4), example.guess(), ocp.radau(3)
    schemes = {"degree": A(3), "control": A(Control.LINEAR)}
    points = REAL | {"falling", "long", "empty"}
    solved = {"solution": A(example.solution()), "errors": A(ocp.estimate(example.solution()))}
    tolerances: list[Call] = []
    for kind in (ocp.Cost, ocp.Share, ocp.Seconds):
        name, one = kind.__name__, kind(1e-3)
        tolerances += [
            Call(f"ocp.{name}", kind, {
                "tol": A(1e-3, POSITIVE), "unit": A("m", ANY_TEXT), "what": A("cost", ANY_TEXT)}),
            Call(f"{name}.error", one.error, solved), Call(f"{name}.parts", one.parts, solved),
        ]  # fmt: skip
    signal = ocp.Signal("q", 1e-3)
    return (
        Call("ocp.Grid", ocp.Grid, {"ends": A([0.0, 0.5, 1.0], NOTHING, ("Grid",))}),
        Call("Grid.locate", grid.locate, {"share": A(np.array([0.0, 0.3]), points)}),
        Call("ocp.given", ocp.given, {"ends": A([0.0, 0.5, 1.0], NOTHING, ("Grid",))}),
        Call("ocp.uniform", ocp.uniform, {"elements": A(5)}),
        Call("ocp.radau", ocp.radau, schemes), Call("ocp.legendre", ocp.legendre, schemes),
        Call("ocp.lobatto", ocp.lobatto, schemes),
        *(Call(f"Scheme.{name}", getattr(scheme, name), {"tau": A(np.array([0.0, 0.5]), points)})
          for name in ("control_at", "state_at", "slope_at", "costate_at")),
        Call("ocp.Guess", ocp.Guess, {
            "share": A([0.0, 1.0]), "x": A([[0.0, 1.0], [1.0, 2.0]], NAN_LATER), "u": A([[0.0], [1.0]], NAN_LATER),
            "duration": A(1.0, AT_LEAST_ZERO), "free": A([], REAL | {"empty", "long", "falling"})}),
        Call("Guess.state", guess.state, {"share": A(np.array([0.0, 0.3]), points | {"cube"})}),
        Call("Guess.control", guess.control, {"share": A(np.array([0.0, 0.3]), points | {"cube"})}),
        Call("ocp.Ipopt", ocp.Ipopt, {
            "tol": A(1e-9, POSITIVE), "max_iter": A(100), "max_seconds": A(5.0, BOUND), "scaled": A(True, TRUTH),
            "progress": A(None, TRUTH | OPTIONAL), "print_level": A(0, frozenset({"zero"})),
            "extra": A({}, frozenset({"map", "names"}))}),
        Call("Ipopt.options", ocp.Ipopt().options, {"warm": A(True, TRUTH), "multipliers": A(False, TRUTH)}),
        *tolerances,
        Call("ocp.Signal", ocp.Signal, {
            "name": A("q", ANY_TEXT), "tol": A(1e-3, POSITIVE), "unit": A("m", ANY_TEXT)}),
        Call("Signal.error", signal.error, solved), Call("Signal.parts", signal.parts, solved),
        Call("ocp.CoarseGrid", ocp.CoarseGrid, {"factor": A(5)}),
        Call("ocp.WiderLimits", ocp.WiderLimits, {"factors": A((8.0, 2.0), frozenset({"long"}))}),
        Call("ocp.ParameterPath", ocp.ParameterPath, {
            "name": A("gravity.g", ANY_TEXT), "easy": A(0.0, REAL), "steps": A(4)}),
        Call("ocp.Smooth", ocp.Smooth), Call("ocp.StraightLine", ocp.StraightLine),
    )  # fmt: skip


def methods() -> tuple[Call, ...]:
    """Return the calls of the integrators and of the simulation."""
    names = ("extrapolation", "dormand_prince_5", "dormand_prince_8", "radau_5", "adams", "bdf")
    adaptive = {"rtol": A(1e-6, POSITIVE), "atol": A(1e-6, POSITIVE | {"long"})}
    step = {"step": A(0.01, POSITIVE)}
    arm = example.system()
    trajectory = ocp.simulate(arm, np.zeros(6), [0.0, 0.0, 0.0], 0.1)
    return (
        *(Call(f"ocp.integrators.{name}", getattr(integrators, name), adaptive) for name in names),
        *(Call(f"ocp.integrators.{name}", getattr(integrators, name), step)
          for name in ("euler", "heun", "runge_kutta_4", "stoermer_verlet")),
        Call("ocp.integrators.predictor_corrector", integrators.predictor_corrector, step | {"corrections": A(2)}),
        Call("ocp.integrators.gauss", integrators.gauss, step | {"stages": A(2)}),
        Call("ocp.integrators.radau_iia", integrators.radau_iia, step | {"stages": A(2)}),
        Call("ocp.simulate", ocp.simulate, {
            "system": A(arm), "x0": A([0.0] * 6), "control": A([0.0, 0.0, 0.0], frozenset({"falling"})),
            "times": A([0.0, 0.01], POSITIVE | {"long"}), "values": A({}, MAP, ("parameter",)),
            "breaks": A((), REAL | {"empty", "falling", "long"}),
            "method": A(None, OPTIONAL), "rtol": A(1e-6, OPTIONAL | POSITIVE), "atol": A(1e-6, OPTIONAL | POSITIVE)}),
        Call("Trajectory.signal", trajectory.signal, {"signal": A("q")}),
    )  # fmt: skip


def solves() -> tuple[Call, ...]:
    """Return the calls that prepare, solve, refine and judge."""
    problem, solution, made = example.problem(), example.solution(), example.prepared()
    grid, ipopt = ocp.uniform(4), ocp.Ipopt(max_iter=0 + 50, progress=False)
    common = {
        "scheme": A(ocp.radau(3), OPTIONAL), "grid": A(grid, OPTIONAL), "solver": A(ipopt, OPTIONAL),
        "values": A({"gravity.g": 9.0}, MAP, ("parameter",)),
    }  # fmt: skip
    guess = {"guess": A(example.guess(), OPTIONAL)}
    times = A([0.0, 0.1], frozenset({"zero"}))
    both = {"solution": A(solution), "problem": A(None, OPTIONAL)}
    file = example.folder() / "solution.npz"
    ocp.save(solution, file)
    phases, later = example.sequence_solution(), frozenset({"zero", "half"})
    return (
        Call("ocp.prepare", ocp.prepare, {
            "problem": A(problem), **common, **guess, "compiled": A(False, TRUTH)}),
        Call("ocp.solve", ocp.solve, {"problem": A(problem), **common, **guess}),
        Call("ocp.multistart", ocp.multistart, {
            "problem": A(problem), "starts": A(1), "seed": A(0, frozenset({"zero"})), "executor": A(None, OPTIONAL),
            **common, "first": A(None, OPTIONAL)}),
        Call("ocp.resolved", ocp.resolved, {
            "solution": A(solution), "solver": common["solver"], "values": common["values"], "seconds": A(9.0, BOUND)}),
        Call("ocp.Allowed", ocp.Allowed, {name: A(1e-6, BOUND) for name in (
            "drift", "violation", "energy", "hamiltonian", "switching")}),
        Call("Report.more_elements", ocp.verify(solution).more_elements, {"name": A("drift", NOTHING)}),
        Call("ocp.solve_to_accuracy", ocp.solve_to_accuracy, {
            "problem": A(problem), "tol": A(1e3, POSITIVE), **common, **guess, "seconds": A(9.0, BOUND),
            "elements": A(10), "finish": A(None, OPTIONAL | {"function", "kind"})}, next),
        Call("ocp.polish", ocp.polish, {
            **both, "scheme": A(ocp.radau(3, Control.COLLOCATED), OPTIONAL), "solver": A(None, OPTIONAL),
            "seconds": A(9.0, BOUND)}),
        Call("ocp.gentle", ocp.gentle, {"problem": A(problem), "weight": A(1e-2, POSITIVE)}),
        Call("ocp.gentlest", ocp.gentlest, {**both, "weight": A(1e-4, POSITIVE), "solver": A(None, OPTIONAL)}),
        Call("ocp.verify", ocp.verify, {**both, "allowed": A(None, OPTIONAL)}),
        Call("ocp.estimate", ocp.estimate, both),
        Call("ocp.smooth", ocp.smooth, {"problem": A(problem), "values": A([9.81], REAL)}),
        Call("ocp.straight_line", ocp.straight_line, {"problem": A(problem), "values": A([9.81], REAL)}),
        Call("Prepared.__call__", made, {
            **guess, "values": common["values"], "problem": A(None, OPTIONAL), "grid": A(None, OPTIONAL)}),
        Call("Ipopt.make", ocp.Ipopt().make, {"nlp": A(made.cold.nlp), "start": A(Start.COLD)}),
        Call("Prepared.proceed", made.proceed, {"solution": A(solution), "values": common["values"]}),
        Call("Prepared.numbers", made.numbers, {"values": common["values"]}),
        Call("Prepared.on", made.on, {
            "problem": A(problem), "grid": A(grid), "settings": A(ipopt), "values": common["values"]}),
        Call("Prepared.adapted", made.adapted, {"problem": A(None, OPTIONAL), "grid": A(None, OPTIONAL)}),
        Call("Prepared.attempt", made.attempt, {
            "guesses": A([example.guess()], NOTHING, ("guess",)), "values": A([[9.81]]), "warm": A(False, TRUTH),
            "rung": A("mine", ANY_TEXT), "spent": A(0.0, AT_LEAST_ZERO), "multipliers": A(None, OPTIONAL)}),
        *(Call(f"Solution.{name}", getattr(solution, name), {"t": times})
          for name in ("x", "u", "rate", "costate", "locate")),
        Call("Solution.signal", solution.signal, {"signal": A("q"), "t": times}),
        Call("Solution.samples", solution.samples, {
            "tau": A(np.array([0.0, 0.5]), frozenset({"zero", "half", "falling"}))}),
        Call("SequenceSolution.signal", phases.signal, {"signal": A("q"), "t": A([0.0, 0.1], later)}),
        *(Call(f"SequenceSolution.{name}", getattr(phases, name), {"t": A([0.0, 0.1], later)})
          for name in ("x", "u", "costate")),
        Call("ocp.save", ocp.save, {"solution": A(solution), "path": A(file, frozenset({"text"}))}),
        Call("ocp.load", ocp.load, {"path": A(file), "problem": A(None, OPTIONAL)}),
        Call("Structure.switches", ocp.Structure((_row(),), ()).switches, {"name": A("u", NOTHING, ("row",))}),
    )  # fmt: skip


def _row() -> ocp.solution.structure.Row:
    return ocp.solution.structure.Row("u", ocp.solution.structure.Kind.LOWER, 0.0, 1.0)


def calls() -> tuple[Call, ...]:
    """Return the calls of `ocp`."""
    return systems() + regions() + grids() + methods() + solves()
