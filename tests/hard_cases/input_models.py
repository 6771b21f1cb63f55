"""Valid calls of what describes machines, effects and motions, and what fits their arguments."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

import numpy as np

import models
from hard_cases import input_examples as example
from hard_cases.input_call import (
    ANY_TEXT,
    AT_LEAST_ZERO,
    BOUND,
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
from models import Motion, effects, forms
from ocp import System

A = Argument


def machines() -> tuple[Call, ...]:
    """Return the calls of machines, forms, scenes and the functions of a machine."""
    arm, on = example.machine(), example.EFFECTS
    made = tuple(
        Call(f"models.{make.__name__}", make, {
            name: A(True, TRUTH) if name == "physical" else _parameter(name, parameter.default)
            for name, parameter in inspect.signature(make).parameters.items()
        })
        for make in (models.cylindrical, models.spherical, models.torus)
    )  # fmt: skip
    both = {"machine": A(arm), "effects": A(on, LIST)}
    scene = models.Scene(arm, tuple(on))
    return (
        *made,
        Call("Manipulator.frame", arm.frame, {"name": A("regular", NOTHING, ("frame",)), "added": A(None, OPTIONAL)}),
        *(Call(f"models.forms.{name}", getattr(forms, name), both | {
            "frame": A("coordinate" if name == "inverse" else "regular", OPTIONAL)}) for name in forms.__all__),
        Call("models.Scene", models.Scene, both | {"form": A(forms.hamel, frozenset({"function"})),
            "frame": A("ldl", OPTIONAL)}),
        Call("Scene.without", scene.without, {"effect": A(on[0])}),
        Call("models.Parameter", lambda value: models.cylindrical(A=models.Parameter(value)), {
            "value": A(1.0, REAL, ("A",))}),
        Call("models.inverse_dynamics", models.inverse_dynamics, both),
        Call("models.drive_dynamics", models.drive_dynamics, both),
        Call("models.split_torques", models.split_torques, both),
        Call("models.recover", models.recover, both | {"system": A(example.system())}),
        Call("models.estimate", models.estimate, both | {
            "system": A(example.system()), "solution": A(example.solution()),
            "candidates": A([effects.Coulomb(2.0)], LIST | OPTIONAL)}),
        Call("models.right_hand_side", models.right_hand_side, {
            "system": A(example.system()), "name": A("rate", frozenset({"text"}))}),
        Call("models.write_code", models.write_code, {
            "functions": A([models.right_hand_side(example.system())]), "path": A(example.folder() / "input.c")}),
        Call("models.write_function", models.write_function, {
            "function": A(models.right_hand_side(example.system())),
            "path": A(example.folder() / "input.casadi", frozenset({"text"}))}),
    )  # fmt: skip


def _parameter(name: str, default: object) -> Argument:
    value = default if isinstance(default, float) else 0.9 if name.startswith("Theta") else 0.4
    if name == "l_T" or (name.startswith("Theta") and name[-1] != name[-2]) or name in ("A", "B", "s_2"):
        return A(value, REAL | {"half"}, ("Theta",))
    return A(value, POSITIVE | ({"zero"} if name.startswith(("L_",)) else NOTHING))


def acting() -> tuple[Call, ...]:
    """Return the calls of the effects."""
    each = frozenset({"falling"})  # a list may be of any length until it meets a machine
    many, some = each | {"long", "half"}, each | {"long", "half", "nones", "none"}
    zero = frozenset({"zero"})
    vector = A((0.0, 0.0, 1.0), frozenset({"falling"}))
    table: dict[str, dict[str, Argument]] = {
        "Coulomb": {"f": A(1.0, many | zero | {"nones"}), "width": A(0.1, many - each | {"nones"})},
        "Counterbalance": {
            "mass": A(1.0, AT_LEAST_ZERO), "stiffness": A(1.0, AT_LEAST_ZERO), "at": vector, "anchor": vector,
            "free_length": A(0.1, AT_LEAST_ZERO), "body": A(None, ANY_TEXT | OPTIONAL)},
        "ElasticDrive": {
            "stiffness": A(1e4, some - each), "inertia": A(1.0, some - each),
            "damping": A(0.0, many | zero | {"nones"})},
        "GearEfficiency": {
            "efficiency": A(0.9, frozenset({"half", "nones", "falling", "none"})),
            "width": A(0.02, many - each | {"nones"}), "torque": A(0.1, many - each | {"nones"})},
        "Gravity": {"g": A(9.81, REAL), "direction": vector},
        "JointStop": {
            "lower": A(-1.0, some | REAL), "upper": A(1.0, some | REAL), "stiffness": A(1e5, many - each | {"nones"}),
            "damping": A(0.5, many | zero | {"nones"}), "width": A(1e-3, many - each | {"nones"})},
        "LaggedDrive": {"time_constant": A(0.01, some - each)},
        "MotionLimits": {
            "acceleration": A(20.0, some - each), "jerk": A(None, some - each),
            "tool_speed": A(1.0, POSITIVE | OPTIONAL)},
        "MotorDrive": {
            "constant": A(0.1, some - each), "resistance": A(1.0, some - each),
            "inductance": A(0.0, many | zero | {"nones"}), "ratio": A(100.0, many | REAL | {"nones"})},
        "Payload": {"mass": A(2.0, AT_LEAST_ZERO), "offset": vector, "inertia": A((1.0, 1.0, 1.0))},
        "PowerLimit": {"limit": A(100.0, POSITIVE), "brake": A(10.0, AT_LEAST_ZERO | OPTIONAL)},
        "RotorInertia": {
            "inertia": A(1e-4, many | zero | {"nones"}), "ratio": A(100.0, many | REAL | {"nones"}),
            "coupling": A(None, OPTIONAL), "carried": A(False, TRUTH)},
        "Stribeck": {
            "f": A(1.0, many | zero | {"nones"}), "f_static": A(1.5, many | zero | {"nones"}),
            "speed": A(0.1, many - each | {"nones"}), "width": A(0.01, many - each | {"nones"})},
        "ToolForce": {
            "force": A((0.0, 0.0, 1.0), frozenset({"falling", "function"})),
            "moment": A((0.0, 0.0, 0.0), frozenset({"falling", "function"})),
            "of": A(("time",), frozenset({"words", "text"})),
            "in_tool_axes": A(False, TRUTH)},
        "TorqueRate": {"rate": A(2e3, some - each)},
        "TorqueSpeed": {
            "stall": A(100.0, some - each), "no_load": A(4.0, some - each), "peak": A(None, some - each)},
        "Viscous": {"c": A(1.0, many | zero | {"nones"})},
        "WindingHeat": {
            "resistance": A(1.0, some - each), "capacity": A(100.0, some - each), "limit": A(400.0, some - each),
            "ambient": A(293.0, POSITIVE), "initial": A(None, POSITIVE | OPTIONAL)},
    }  # fmt: skip
    return tuple(Call(f"models.effects.{name}", getattr(effects, name), given) for name, given in table.items())


def motions() -> tuple[Call, ...]:
    """Return the calls of motions, paths and what is asked of drives."""
    arm, motion, noisy = example.machine(), example.motion(), example.samples()
    t, q = np.array([0.0, 0.5, 1.0]), np.array([[0.0, 0.2, 0.5], [0.3, 0.3, 0.6], [0.5, 0.4, 0.7]])
    three = frozenset({"falling"})
    ends = {"q0": A(example.Q0, three), "q1": A(example.Q1, three)}
    speeds = {name: A(2.0, POSITIVE) for name in ("velocity", "acceleration", "jerk")}
    length = A(None, OPTIONAL)
    at = A(np.array([0.0, 0.5]), frozenset({"zero", "half", "falling"}))
    noise = A(None, OPTIONAL | AT_LEAST_ZERO)
    line = models.line([0.4, 0.3, 0.5], [0.5, 0.4, 0.6])
    law = Motion.trapezoidal(0.0, line.length, 0.5, 2.0)
    inverse = {
        "near": A(None, OPTIONAL | {"falling"}),
        "hold": A(None, MAP),
        "limits": A(None, OPTIONAL),
        "branch": A(None, OPTIONAL),
    }
    point = A([1.0, 0.0, 0.0], frozenset({"falling"}))
    path = models.path_through(q)
    floor = models.path_system(arm, example.NUMBERS, path)
    files = {"machine": A(arm, OPTIONAL), "noise": noise, "joints": A(None, MAP)}
    table = motion.torques(arm, example.EFFECTS, times=[0.0, 0.2, 0.4], values={"gravity.g": 9.0})
    return (
        *(Call(f"Motion.{name}", getattr(motion, name), {"t": at}) for name in ("q", "v", "a", "jerk")),
        Call("Motion.derivative", motion.derivative, {"t": at, "order": A(1, frozenset({"zero"}))}),
        Call("Motion.torques", motion.torques, {
            "machine": A(arm), "effects": A(example.EFFECTS, LIST),
            "times": A([0.0, 0.5], OPTIONAL, ("t",)), "values": A({"gravity.g": 9.0}, MAP, ("parameter",)),
            "limits": A((), LIST), "progress": A(None, OPTIONAL | {"function"})}),
        Call("TorqueTable.rms", table.rms, {"values": A(table.tau)}),
        Call("TorqueTable.drives_at", table.drives_at, {"t": A([0.1, 0.2], frozenset({"zero"}))}),
        Call("Motion.quintic", Motion.quintic, ends | {"duration": A(1.0, POSITIVE)}),
        Call("Motion.septic", Motion.septic, ends | {"duration": A(1.0, POSITIVE)}),
        Call("Motion.trapezoidal", Motion.trapezoidal, ends | {
            "velocity": speeds["velocity"], "acceleration": speeds["acceleration"], "duration": length}),
        Call("Motion.s_curve", Motion.s_curve, ends | speeds | {"duration": length}),
        Call("Motion.through", Motion.through, {
            "times": A(t), "waypoints": A(q, three), "degree": A(5),
            "ends": A(None, OPTIONAL)}),
        Call("Motion.from_samples", Motion.from_samples, {
            "t": A(noisy.times), "q": A(noisy.samples), "v": A(None, OPTIONAL),
            "a": A(None, OPTIONAL), "noise": noise, "labels": A((), LIST)}),
        Call("Motion.from_csv", Motion.from_csv, {"path": A(_written("csv")), **files}),
        Call("Motion.from_trajectory", Motion.from_trajectory, {"path": A(_written("json")), **files}),
        Call("models.Motor", models.Motor, {
            "name": A("M1", ANY_TEXT), "inertia": A(1e-4, POSITIVE), "rated": A(1.0, POSITIVE), "peak": A(3.0, BOUND),
            "speed": A(500.0, BOUND), "constant": A(0.1, POSITIVE | OPTIONAL)}),
        Call("models.size_gears", models.size_gears, {
            "table": A(motion.torques(arm, example.NUMBERS)), "drive": A(0, frozenset({"zero"})),
            "motors": A([models.Motor("M1", 1e-4, 1.0)]), "ratios": A([100.0], frozenset({"long", "half"})),
            "efficiency": A(0.9, POSITIVE)}),
        Call("Motion.of", Motion.of, {"solution": A(example.solution()), "system": A(None, OPTIONAL)}),
        Call("Motion.of_time", Motion.of_time, {
            "q": A(lambda t: t), "end": A(1.0, POSITIVE), "start": A(0.0, REAL), "v": A(None, OPTIONAL | {"function"}),
            "a": A(None, OPTIONAL | {"function"}), "smoothness": A(4.0, BOUND | REAL | {"minus_inf"}),
            "labels": A((), LIST)}),
        Call("Motion.piecewise", Motion.piecewise, {
            "curve": A(motion.curve), "labels": A((), LIST),
            "smoothness": A(None, BOUND | REAL | {"none", "minus_inf"})}),
        Call("Motion.recorded", Motion.recorded, {"recording": A(_recording()), "noise": noise}),
        Call("models.Envelope", models.Envelope, {
            "peak": A(1.0, BOUND), "speed": A(9.0, BOUND), "corner": A(None, POSITIVE | OPTIONAL),
            "continuous": A(1.0, BOUND), "power": A(1.0, BOUND)}),
        Call("Envelope.torque", models.Envelope(1.0, 2.0).torque, {
            "speed": A(np.array([0.0]), REAL | {"inf", "minus_inf", "infs", "long", "falling", "empty", "cube"})}),
        Call("models.straight_path", models.straight_path, {
            "machine": A(arm), "effects": A(example.NUMBERS, LIST), "begin": A(q[0].tolist(), three),
            "finish": A(q[1].tolist(), three), "limits": A({"tau": [100.0, 100.0, 100.0]}, MAP, ("signal",))}),
        Call("models.states_along", models.states_along, {
            "motion": A(motion), "system": A(example.system()), "machine": A(arm), "effects": A(example.EFFECTS, LIST),
            "points": A(5)}),
        Call("models.line", models.line, {"start": point, "end": A([0.0, 2.0, 0.0], frozenset({"falling"}))}),
        Call("models.arc", models.arc, {
            "start": point, "via": A([0.0, 2.0, 0.0], frozenset({"falling"})),
            "end": A([0.0, 0.0, 3.0], frozenset({"falling"}))}),
        Call("models.sampled", models.sampled, {"points": A(q, NOTHING, ("sampled",))}),
        Call("models.path_through", models.path_through, {
            "waypoints": A(q, frozenset({"long", "falling"}), ("waypoint",)), "degree": A(5, OPTIONAL),
            "ends": A(None, OPTIONAL)}),
        Call("models.path_system", models.path_system, {
            "machine": A(arm), "effects": A(example.NUMBERS, LIST), "path": A(path)}),
        Call("models.timed", models.timed, {"path": A(path), "solution": A(_timing(floor))}),
        Call("models.along_tool_path", models.along_tool_path, {
            "machine": A(arm), "path": A(line), "law": A(law), "rotation": A(None, OPTIONAL), **inverse}),
        Call("models.through_tool_points", models.through_tool_points, {
            "machine": A(arm), "times": A([0.0, 1.0]),
            "points": A([[0.4, 0.3, 0.5], [0.5, 0.4, 0.6]]), "ends": A(None, OPTIONAL),
            "rotation": A(None, OPTIONAL), **inverse}),
    )  # fmt: skip


def _written(suffix: str) -> Path:
    """Write the samples as a file that can be read."""
    noisy = example.samples()
    path = example.folder() / f"input.{suffix}"
    rows = np.column_stack([noisy.times, noisy.samples])  # type: ignore[list-item]
    if suffix == "csv":
        np.savetxt(path, rows, delimiter=",", header="t,q1,q2,q3", comments="")
    else:
        points = [{"time_from_start": row[0], "positions": row[1:]} for row in rows.tolist()]
        path.write_text(json.dumps({"joint_names": ["phi", "xi", "r"], "points": points}), encoding="utf-8")
    return path


def _recording() -> object:
    from models.motions.recording import Recording

    noisy = example.samples()
    return Recording(noisy.times, noisy.samples)  # type: ignore[arg-type]


def _timing(system: System) -> object:
    from ocp import Bolza, Free, Problem, along, end, solve, start, uniform

    problem = Problem(system, Free(1.0), Bolza(1.0), (
        start(system["s"], 0.0), start(system["ds"], 0.0), end(system["s"], 1.0), end(system["ds"], 0.0),
        along(system["dds"], -4.0, 4.0)))  # fmt: skip
    return solve(problem, grid=uniform(4))


def calls() -> tuple[Call, ...]:
    """Return the calls of `models`."""
    return machines() + acting() + motions()
