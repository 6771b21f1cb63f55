"""Every effect in every form: the same accelerations, a closed balance of power, torques split without a rest."""

import casadi as ca
import numpy as np
import pytest
from catalogue.effect_cases import CASES, EVERYTHING, everything
from catalogue.machines import NAMES, acceleration, evaluate, machine, relative, states

from models import drive_dynamics, inverse_dynamics, recover, split_torques
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.mechanics.mechanics import assemble

FORMS = (lagrange, hamel, canonical)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
EACH_CASE = pytest.mark.parametrize("case", [*CASES, "everything"])
COUNT = 20


def effects_of(case, arm):
    n = len(arm.coordinates)
    return everything(n) if case == "everything" else CASES[case](n)


def sample(arm, effects, form):
    """Return the system of a form, and states x and controls u at given q and v, one column for each."""
    system, mechanics = form(arm, effects), assemble(arm, effects)
    q, v, u = states(arm, COUNT, seed=6)
    u = u / 6.0
    added = mechanics.terms.metric
    third = v
    if form is not lagrange:
        basis = mechanics.frame("regular")
        w = basis.matrix @ arm.v
        (third,) = evaluate([arm.q, arm.v], [w if form is hamel else basis.metric @ w], q, v)
    size = system.x.numel() - 2 * len(q)
    assert added is None or added.shape == (len(q), len(q))
    rng = np.random.default_rng(8)
    near = {"motor_q": q, "motor_v": v}
    extra = []
    for label in system.labels["x"][2 * len(q) :]:
        kind = next((kind for kind in near if label.name.startswith(kind)), None)
        names = [f"{kind}_{c.name}" for c in arm.coordinates]
        base = near[kind][names.index(label.name)] if kind else np.zeros(COUNT)
        extra.append(base + rng.uniform(-0.01, 0.01, COUNT) * (1.0 if kind else 500.0))
    return system, np.vstack([q, third, *extra]) if size else np.vstack([q, third]), u, (q, v)


@EACH_CASE
@pytest.mark.parametrize("name", NAMES)
def test_forms_agree_and_power_balances(name, case):
    arm = machine(name)
    effects = effects_of(case, arm)
    results = []
    for form in FORMS:
        system, x, u, (q, v) = sample(arm, effects, form)
        loss = system.signals.get("loss", ca.SX(0))
        slope = ca.gradient(system["energy"], system.x) * system.rate
        rest = system.rate[2 * len(q) :]
        wanted = [acceleration(system), ca.sum1(slope), system["power"] - loss, ca.norm_inf(slope), system["v"], rest]
        got = evaluate([system.x, system.u], [*wanted, system["energy"], loss, system["power"]], x, u)
        a, stored, supplied, largest, velocity, rates, energy, loss, power = got
        size = np.maximum(largest, np.max(np.abs([power, loss]), axis=0))
        assert relative(velocity, v) < 1e-11
        assert relative(stored, supplied, size + 1e-9) < 1e-10
        results.append((a, rates, energy, power))
    (a, rates, energy, power), *others = results
    for other in others:
        assert relative(other[0], a) < 2e-12 * conditioning(arm, effects, q)
        if len(rates):
            assert relative(other[1], rates) < 1e-11
        assert relative(other[2], energy, np.max(np.abs(energy))) < 1e-12
        assert relative(other[3], power, np.max(np.abs(power)) + 1e-9) < 1e-11


def conditioning(arm, effects, q):
    """Return the root of the largest condition number of the metric, which the forms need not share errors below."""
    (metric,) = evaluate([arm.q], [assemble(arm, effects).metric], q)
    return float(np.sqrt(np.max(np.linalg.cond(np.moveaxis(metric, 2, 0)))))


@EACH_CASE
@pytest.mark.parametrize("name", ["cylinder", "sphere_general", "torus_general"])
def test_torques_of_joints_are_recovered_and_split(name, case):
    arm = machine(name)
    effects = effects_of(case, arm)
    system, x, u, (q, v) = sample(arm, effects, canonical)
    rate, a, tau = evaluate([system.x, system.u], [system.rate, acceleration(system), system["tau"]], x, u)
    got = recover(system, arm, effects).map(COUNT)(x, rate, np.zeros((0, COUNT)))
    scale = np.max(np.abs(got[3].full()), axis=0) + np.max(np.abs(tau), axis=0)
    assert relative(np.array(got[2]), a) < 1e-11
    assert relative(np.array(got[3]), tau, scale) < 1e-9
    whole, parts = inverse_dynamics(arm, effects), split_torques(arm, effects)
    time = [x[-1:]] if whole.n_in() == 5 else []
    total = np.array(whole.map(COUNT)(q, v, a, np.zeros((0, COUNT)), *time))
    split = parts.map(COUNT)(q, v, a, np.zeros((0, COUNT)), *time)
    pieces = [np.array(piece) for piece in split]
    assert relative(sum(pieces), total, sum(np.max(np.abs(piece), axis=0) for piece in pieces)) < 1e-13
    assert parts.name_out()[:2] == ["inertia", "coriolis"]


def test_parts_are_called_by_effects_and_mean_them():
    arm = machine("torus")
    q, v, a = states(arm, COUNT, seed=9)
    empty = np.zeros((0, COUNT))
    effects = everything(3)
    names = split_torques(arm, effects).name_out()
    assert names == ["inertia", "coriolis", "payload", "gravity", "viscous", "coulomb", "rotor_inertia", "joint_stop",
                     "tool_force", "counterbalance"]  # fmt: skip
    assert len(EVERYTHING) == 9
    # Leaving an effect out leaves its part out; the load's weight goes with gravity, too.
    bare = np.array(inverse_dynamics(arm, effects[1:]).map(COUNT)(q, v, a, empty))
    whole = np.array(inverse_dynamics(arm, effects).map(COUNT)(q, v, a, empty))
    load = dict(zip(names, split_torques(arm, effects).map(COUNT)(q, v, a, empty), strict=True))["payload"]
    assert relative(whole - bare, np.array(load), np.max(np.abs(whole), axis=0)) < 1e-12
    twice = split_torques(arm, [Gravity(5.0), Gravity(4.81)])
    assert twice.name_out()[2:] == ["gravity", "gravity_2"]


@pytest.mark.parametrize("case", ["elastic_behind_lag", "motor_drive", "motor_behind_elastic", "elastic_in_part"])
@pytest.mark.parametrize("name", ["cylinder", "sphere", "torus"])
def test_drives_of_a_motion_make_that_motion(name, case):
    # Along a polynomial motion the states of the drives follow from drive_dynamics; the system must agree with them.
    arm = machine(name)
    n = len(arm.coordinates)
    effects = [Gravity(), *CASES[case](n)]
    needs = drive_dynamics(arm, effects)
    depth = needs.n_in() - 1
    rng = np.random.default_rng(4)
    coefficients = rng.uniform(-0.3, 0.3, (n, 8))
    t = ca.SX.sym("t")
    q = ca.SX(coefficients) @ ca.vertcat(*(t**k for k in range(8)))
    motion = [q]
    for _ in range(depth - 1):
        motion.append(ca.jacobian(motion[-1], t))
    outputs = dict(zip(needs.name_out(), needs(*motion, []), strict=True))
    system = lagrange(arm, effects)
    names = [label.name for label in system.labels["x"][2 * n :]]
    series = {f"drive_tau_{c.name}": outputs["motor_tau"][i] for i, c in enumerate(arm.coordinates)}
    for i, c in enumerate(arm.coordinates):
        series |= {f"motor_q_{c.name}": outputs["motor_q"][i], f"motor_v_{c.name}": outputs["motor_v"][i]}
        series |= {f"current_{c.name}": outputs["current"][i]} if "current" in outputs else {}
    x = ca.vertcat(q, motion[1], *(series[key] for key in names))
    control = next(outputs[key] for key in ("command", "voltage", "motor_tau") if key in outputs)
    rate = ca.Function("f", [system.x, system.u, system.p], [system.rate])(x, control, [])
    wanted, got = evaluate([t], [ca.jacobian(x, t), rate], np.linspace(0.1, 0.9, 9)[None, :])
    assert relative(got, wanted, np.maximum(np.max(np.abs(wanted), axis=1, keepdims=True), 1e-3)) < 1e-9
