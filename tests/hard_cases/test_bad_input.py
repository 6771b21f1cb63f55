"""Bad input to everything public is refused with one sentence; the valid calls stand in the files input_*."""

import dataclasses
import enum
import inspect

import pytest

import models
import ocp
from hard_cases import input_files, input_pairs, input_stores
from hard_cases.bad_input import CASES, PARTS, figure
from hard_cases.case import run
from hard_cases.input_call import BAD, Fault, extremes, fault, refusals
from models import effects, forms
from ocp import integrators

CALLS = {call.name: call for _, part in PARTS for call in part()}
# Made by the product, not by users: what constructs them has been checked.
MADE = {
    "ocp": {
        "Accuracy", "Constraint", "Errors", "Multipliers", "Optimum", "Outcome", "Prepared", "PreparedStructure",
        "Report", "Scheme", "Sensitivity", "SequenceSensitivity",
        "SequenceSolution", "Solution", "StoreError", "Structure", "StudyTable",
        "Timings", "Trajectory",
    },
    "models": {"DriveLoad", "Estimate", "Manipulator", "Motion", "Sizing", "TorqueTable"},
}  # fmt: skip
PROTOCOLS = {"ocp.Tolerance"}
# Methods by which an effect takes part in estimates (see models/mechanics/contributions.py): the package calls them.
HOOKS = {"typical", "contribution", "mean_loss"}
MODULES = {"ocp": ocp, "models": models, "models.effects": effects, "models.forms": forms}


def public():
    """Yield package, name and value of everything public; the integrators are all functions of their module."""
    for package, module in MODULES.items():
        for name in module.__all__:
            yield package, name, getattr(module, name)
    for name, value in vars(integrators).items():
        if inspect.isfunction(value) and value.__module__ == integrators.__name__:
            yield "ocp.integrators", name, value


def methods(kind):
    """Yield the names of public methods of a class that take arguments."""
    fields = {field.name for field in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    for name, value in vars(kind).items():
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if name.startswith("_") or name in fields | HOOKS or not inspect.isfunction(function):
            continue
        if len(inspect.signature(function).parameters) > 1:
            yield name


def wanted():
    """Yield the names of all calls that the table must have."""
    for package, name, value in public():
        if inspect.ismodule(value) or (inspect.isclass(value) and issubclass(value, enum.Enum)):
            continue
        if f"{package}.{name}" in PROTOCOLS:
            continue
        if name not in MADE.get(package, ()):
            yield f"{package}.{name}"
        if inspect.isclass(value):
            yield from (f"{name}.{method}" for method in methods(value))


def test_every_public_name_has_a_valid_call():
    missing = sorted(set(wanted()) - set(CALLS))
    assert not missing, f"no valid call in scripts/hard_cases/input_*.py: {', '.join(missing)}"


def test_every_call_has_all_arguments_of_its_function():
    for name, call in CALLS.items():
        parameters = inspect.signature(call.function).parameters.values()
        named = {one.name for one in parameters if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)}
        assert named <= set(call.arguments), f"{name}: {', '.join(named - set(call.arguments))}"


def test_the_completeness_test_sees_what_is_missing():
    names = set(wanted())
    assert {
        "ocp.solve",
        "models.torus",
        "models.effects.Viscous",
        "models.forms.hamel",
        "ocp.integrators.gauss",
    } <= names
    assert {"Solution.x", "Motion.quintic", "Scene.without", "Prepared.attempt", "Grid.locate", "Signal.error"} <= names
    assert {"ocp.sweep", "Study.run", "Store.claim", "StudyTable.row", "Sensitivity.switches"} <= names
    assert len(names) > 150


def available(name):
    """Return a call, or skip the test where the library that it needs is not installed."""
    call = CALLS[name]
    if call.needs:
        pytest.importorskip(call.needs, reason=f"{call.needs} is not installed")
    return call


LONG = "models.along_tool_path", "models.through_tool_points"  # seconds each


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in sorted(CALLS)]
)
def test_bad_values_are_refused_in_one_sentence(name):
    call = available(name)
    call()
    faults = [str(fault) for _, _, fault in refusals(call) if fault is not None]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("name", sorted(CALLS))
def test_numbers_of_extreme_size_are_refused_or_taken_without_nan(name):
    faults = [str(fault) for _, _, fault in extremes(available(name)) if fault is not None]
    assert not faults, "\n".join(faults)


def test_parts_that_do_not_belong_together_are_refused_in_one_sentence():
    result = list(input_pairs.refusals())
    faults = [str(fault) for _, _, fault in result if fault is not None]
    assert not faults, "\n".join(faults)
    assert len(result) > 70


def test_broken_files_are_refused_in_one_sentence(tmp_path):
    faults = [str(fault) for _, _, fault in input_files.refusals(tmp_path) if fault is not None]
    assert not faults, "\n".join(faults)
    good = tmp_path / "good.npz"
    good.write_bytes(input_files._good())
    assert ocp.load(good).ok


def test_broken_stores_are_refused_in_one_sentence(tmp_path):
    result = list(input_stores.refusals(tmp_path))
    assert len(result) > 70
    faults = [str(fault) for _, _, fault in result if fault is not None]
    assert not faults, "\n".join(faults)
    good = tmp_path / "good.db"
    good.write_bytes(input_stores._good())
    assert input_stores._read(good).ok.all()
    assert input_stores._solution(good).ok


def test_the_judge_sees_bad_answers():
    def foreign(x):
        return 1.0 / x

    def silent(x):
        return None

    def other(x):
        raise ValueError("something went wrong")

    def lines(x):
        raise ValueError("x: got 3,\nexpected 2")

    def named(words):
        raise ValueError(words)

    assert "ZeroDivisionError" in fault(lambda: foreign(0), ("x",))
    assert "accepted" in fault(lambda: silent(0), ("x",))
    assert "not said by the product" in fault(lambda: float("a"), ("float",))
    assert "does not name x" in fault(lambda: other(0), ("x",))
    assert "no one sentence" in fault(lambda: lines(0), ("x",))
    assert "does not show the value" in fault(lambda: named("x: expected a number"), ("x",), ("nan",))
    assert "does not say what is expected" in fault(lambda: named("x: got nan"), ("x",), ("nan",))
    assert fault(lambda: ocp.uniform(0), ("uniform",), ("0",)) == ""
    assert len(BAD) >= 25


def test_cases_of_the_stability_suite_count_the_faults():
    assert not any(case.outside for case in CASES)
    assert sum(case.fast for case in CASES) >= len(CASES) - 2
    regions = next(case for case in CASES if case.name == "regions")
    assert run(regions).passed
    wrong = figure([("x", "nan", None), ("x", "inf", Fault("f", "x", "inf", "accepted, float"))])
    assert wrong.value == 1.0
    assert not wrong.passed
    assert "f(x = inf): accepted" in wrong.note
