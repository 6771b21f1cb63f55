"""An effect that is off leaves no trace: the same graph as a machine that never heard of it."""

import dataclasses
import inspect

import casadi as ca
import numpy as np
import pytest
from catalogue.effect_cases import CASES, EVERYTHING
from catalogue.machines import NAMES, instructions, machine

import models.effects
from models import Parameter
from models.effects import (
    Coulomb,
    Counterbalance,
    ElasticDrive,
    Gravity,
    JointStop,
    LaggedDrive,
    MotionLimits,
    MotorDrive,
    Payload,
    RotorInertia,
    Stribeck,
    ToolForce,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.forms import canonical, hamel, lagrange
from models.mechanics.terms import name_of

FORMS = (canonical, hamel, lagrange)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
EFFECTS = [getattr(models.effects, name) for name in models.effects.__all__]
# Instructions of x' without effects, canonical, hamel, lagrange, counted before any effect but gravity and the point
# load existed; CasADi 3.8.2.
UNHEARD = {
    "cylinder": (34, 36, 36),
    "cylinder_left": (34, 36, 36),
    "cylinder_centred": (29, 31, 31),
    "sphere": (63, 70, 75),
    "sphere_general": (124, 136, 161),
    "torus": (81, 89, 99),
    "torus_offset": (122, 134, 144),
    "torus_general": (154, 166, 176),
}
# Every effect switched off in the ways its parameters offer: no drive has it, or its size is zero.
OFF = {
    "gravity": lambda n: [Gravity(0.0)],
    "payload": lambda n: [Payload(0.0), Payload(0.0, (0.1, 0.2, 0.3))],
    "viscous": lambda n: [Viscous(0.0)],
    "viscous_nowhere": lambda n: [Viscous((None,) * n)],
    "coulomb": lambda n: [Coulomb(0.0)],
    "coulomb_nowhere": lambda n: [Coulomb((None,) * n)],
    "stribeck": lambda n: [Stribeck(0.0, 0.0)],
    "stribeck_nowhere": lambda n: [Stribeck((None,) * n, 1.0)],
    "rotor_inertia": lambda n: [RotorInertia(0.0)],
    "rotor_nowhere": lambda n: [RotorInertia((None,) * n)],
    "lagged_drive": lambda n: [LaggedDrive((None,) * n)],
    "elastic_drive": lambda n: [ElasticDrive((None,) * n, (None,) * n)],
    "motor_drive": lambda n: [MotorDrive((None,) * n, 1.0)],
    "winding_heat": lambda n: [MotorDrive((None,) * n, 1.0), WindingHeat((None,) * n, 1.0)],
    "torque_speed": lambda n: [TorqueSpeed((None,) * n, 1.0)],
    "joint_stop": lambda n: [JointStop()],
    "tool_force": lambda n: [ToolForce()],
    "tool_force_of_time": lambda n: [ToolForce(lambda t: (0, 0, 0))],
    "counterbalance": lambda n: [Counterbalance()],
}


def shape(system):
    """Return all that a trace would show in."""
    slopes = [ca.jacobian_sparsity(system.rate, part).get_triplet() for part in (system.x, system.u)]
    sizes = {name: signal.numel() for name, signal in system.signals.items()}
    parts = [ca.vertsplit(part) for part in (system.x, system.p)]
    names = [[str(symbol) for symbol in part] for part in parts]
    return instructions(system), slopes, sizes, names, system.nominal, system.limits, system.initial, system.notes


@EACH_FORM
@pytest.mark.parametrize("name", NAMES)
def test_no_effect_leaves_a_trace(name, form):
    arm, other = machine(name), machine(name, 1)
    n = len(arm.coordinates)
    never = shape(form(arm))
    if ca.__version__ == "3.8.2":
        assert never[0] == UNHEARD[name][FORMS.index(form)]
    for case in CASES.values():
        form(arm, case(n))  # scenes with every effect, before one without any
    assert shape(form(arm, [])) == never
    among = {}
    for effects in (EVERYTHING[:5], EVERYTHING[:6]):
        among[effects] = shape(form(other, [effect for case in effects for effect in CASES[case](n)]))
    assert among[EVERYTHING[:5]] != among[EVERYTHING[:6]]
    assert shape(form(other, [effect for case in EVERYTHING[:5] for effect in CASES[case](n)])) == among[EVERYTHING[:5]]


@EACH_FORM
@pytest.mark.parametrize("case", OFF)
@pytest.mark.parametrize("name", NAMES)
def test_effects_of_no_size_leave_no_trace_in_the_motion(name, case, form):
    arm = machine(name)
    off, never = form(arm, OFF[case](len(arm.coordinates))), form(arm)
    assert instructions(off) == instructions(never)
    assert (off.x.numel(), off.u.numel(), off.p.numel()) == (never.x.numel(), never.u.numel(), never.p.numel())
    for part in ("x", "u"):
        before, after = (ca.jacobian_sparsity(s.rate, getattr(s, part)) for s in (never, off))
        assert before == after
    assert (off.nominal, off.limits, off.initial, off.notes) == (
        never.nominal,
        never.limits,
        never.initial,
        never.notes,
    )


@pytest.mark.parametrize("case", CASES)
def test_effects_that_are_on_are_there(case):
    arm = machine("sphere")
    effects, never = CASES[case](4), canonical(arm)
    system = canonical(arm, effects)
    more = set(system.signals) - set(never.signals)
    limits = case in ("torque_speed", "power_limit", "winding_heat", "torque_rate", "motion_limits", "jerk_limit")
    assert bool(system.limits) == limits
    assert instructions(system) > instructions(never) or limits
    assert set(system.limits) <= more


@pytest.mark.parametrize("kind", EFFECTS, ids=lambda kind: kind.__name__)
def test_effects_are_described_by_data(kind):
    assert dataclasses.is_dataclass(kind)
    assert kind.__dataclass_params__.frozen
    words = inspect.getdoc(kind)
    first = words.splitlines()[0]
    assert first.endswith(".")
    for section in ("Adds", "Args:", "Raises:"):
        assert section in words
    for field in dataclasses.fields(kind):
        assert f"    {field.name}" in words or f", {field.name}" in words
        if field.name not in ("body", "of", "in_tool_axes", "carried"):
            assert field.metadata["unit"]


def test_every_number_may_stay_a_symbol():
    arm = machine("sphere")
    seen = set()
    for case in CASES.values():
        for effect in case(4):
            changed = {}
            for field in dataclasses.fields(effect):
                value = getattr(effect, field.name)
                if "scalar" not in field.metadata or value is None or field.name == "initial" or callable(value):
                    continue
                if field.name == "inductance" and value == 0.0:
                    continue  # no state
                several = isinstance(value, tuple)
                wrapped = (
                    tuple(None if v is None else Parameter(float(v)) for v in value) if several else Parameter(value)
                )
                changed[field.name] = wrapped
            symbolic = dataclasses.replace(effect, **changed)
            needs = [MotorDrive(0.1, 1.1, 2e-3)] if isinstance(effect, WindingHeat) else []
            needs += [LaggedDrive(0.02)] if isinstance(effect, MotionLimits) else []
            system = lagrange(arm, [symbolic, *needs])
            plain = lagrange(arm, [effect, *needs])
            assert all(name.startswith(name_of(effect) + ".") for name in system.nominal)
            rng = np.random.default_rng(5)
            point = [rng.uniform(0.5, 0.9, part.numel()) for part in (plain.x, plain.u)]
            given = ca.Function("f", [system.x, system.u, system.p], [system.rate])(*point, system.values())
            number = ca.Function("f", [plain.x, plain.u], [plain.rate])(*point)
            assert np.array(given) == pytest.approx(np.array(number), rel=1e-11, abs=1e-11)
            seen.add(type(effect))
            assert len(system.nominal) == system.p.numel() > 0 or callable(getattr(effect, "force", None))
    assert seen == set(EFFECTS)


def test_fields_say_what_is_wrong():
    arm = machine("sphere")
    for make, message in (
        (lambda: Viscous(-0.1), r"^viscous\.c: got -0\.1 N m s/rad or N s/m, expected a number >= 0"),
        (lambda: Viscous("0.5"), r"^viscous\.c: got '0\.5', expected one finite number"),
        (lambda: Viscous((0.1, np.nan)), r"^viscous\.c_2: got nan"),
        (lambda: Viscous(()), r"^viscous\.c: got no values"),
        (lambda: Viscous(None), r"^viscous\.c: got None"),
        (lambda: Coulomb(1.0, 0.0), r"^coulomb\.width: got 0 rad/s or m/s, expected a number > 0"),
        (
            lambda: MotorDrive(0.1, 1.0, Parameter(0.0)),
            r"^motor_drive\.inductance: got Parameter\(value=0\.0\), expected",
        ),
        (lambda: LaggedDrive(0.0), r"^lagged_drive\.time_constant: got 0 s, expected a number > 0"),
        (lambda: RotorInertia(1e-4, coupling=[[1.0, 2.0]]), r"^rotor_inertia\.coupling: got .*square matrix"),
        (
            lambda: canonical(arm, [Viscous((0.1, 0.2))]),
            r"^viscous\.c: got 2 values, spherical has 4 drives \(theta, psi",
        ),
        (lambda: canonical(arm, [RotorInertia(1e-4, coupling=np.eye(3).tolist())]), r"shape \(3, 3\), spherical has 4"),
        (
            lambda: canonical(arm, [MotorDrive(0.1, (1.0, 1.0, None, 1.0))]),
            r"^motor_drive\.resistance_3: got None, expected a number, as this drive has the rest",
        ),
        (lambda: canonical(arm, [ElasticDrive(1e4, (1.0, 1.0, None, 1.0))]), r"^elastic_drive\.inertia_3: got None"),
    ):
        with pytest.raises(ValueError, match=message):
            make()
