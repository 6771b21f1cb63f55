"""Trees against vectors of another engine, and random trees against positions of bodies in numpy."""

import json
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from rigid_bodies.tree_engine import Engine, random_joints

from models import Joint, Kind, Link, inverse_dynamics, robots, tree
from models.effects import Gravity
from models.forms import canonical, hamel, inverse, lagrange

VECTORS = json.loads((Path(__file__).parent / "data" / "chain_vectors.json").read_text())["robots"]
FRAMES = (None, "coordinate", "innovations", "udu", "ldl")
FORMS = (canonical, hamel, lagrange)
EXACT = 1e-11


@cache
def machine_of(name):
    given = VECTORS[name]
    joints = given["joints"]
    made = []
    for joint in joints:
        t = joint["inertia"]
        entries = tuple(t[i][j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        parent = joints[joint["parent"]]["name"] if joint["parent"] >= 0 else ""
        kind = Kind.REVOLUTE if joint["kind"] == "revolute" else Kind.PRISMATIC
        made.append(
            Joint(joint["name"], kind, parent, joint["origin"], joint["rotation"], joint["axis"],
                  Link(joint["mass"], joint["centre"], entries), rotor=joint["rotor"])
        )  # fmt: skip
    tool = given["tool"]
    return tree(made, tip=joints[tool["joint"]]["name"], tool=tool["origin"], tool_rotation=tool["rotation"], name=name)


def relative(value, wanted):
    value, wanted = np.array(value).ravel(), np.array(wanted).ravel()
    return np.max(np.abs(value - wanted)) / max(np.max(np.abs(wanted)), 1e-300)


def state_of(form, frame, arm, q, v, p):
    """Return the second half of the state of a form in a frame."""
    if frame is None:
        frame = "innovations" if form is hamel else "coordinate"
    if form is lagrange:
        return v
    turned = ca.Function("frame", [arm.q], [ca.densify(arm.frame(frame).matrix)])(q)
    if form is hamel:
        return np.array(turned) @ v
    return np.linalg.solve(np.array(turned).T, p)


def accelerations(system, q, third, tau):
    """Return v, dv/dt and the rate of a form at one state."""
    function = ca.Function("a", [system.x, system.u], [system["v"], ca.jacobian(system["v"], system.x) @ system.rate])
    return (np.array(part).ravel() for part in function(np.concatenate([q, np.ravel(third)]), tau))


ORDINARY = [(name, form, None) for name in VECTORS for form in FORMS] + [
    ("ur5", canonical, "ldl"),
    ("3R", hamel, "udu"),
]
EVERY = [(name, form, frame) for name in VECTORS for form in FORMS for frame in FRAMES]
REST = [case for case in EVERY if case not in ORDINARY]


@pytest.mark.parametrize("name", VECTORS)
def test_torques_of_given_accelerations_are_those_of_the_other_engine(name):
    system = inverse(machine_of(name), [Gravity()])
    torques = ca.Function("tau", [system.x, system.u], [system["tau"]])
    for state in VECTORS[name]["states"]:
        found = torques(np.concatenate([state["q"], state["v"]]), state["given_acceleration"])
        assert relative(found, state["inverse_dynamics"]) < EXACT


@pytest.mark.parametrize(("name", "form", "frame"), ORDINARY)
def test_every_form_moves_as_the_other_engine_says(name, form, frame):
    check_form(name, form, frame)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "form", "frame"), REST)
def test_every_form_in_every_frame_moves_as_the_other_engine_says(name, form, frame):
    check_form(name, form, frame)


def check_form(name, form, frame):
    arm = machine_of(name)
    system = form(arm, [Gravity()], frame)
    for state in VECTORS[name]["states"]:
        q, v, tau = (np.array(state[key]) for key in ("q", "v", "tau"))
        speed, a = accelerations(system, q, state_of(form, frame, arm, q, v, np.array(state["momentum"])), tau)
        assert relative(speed, v) < EXACT
        assert relative(a, state["acceleration"]) < EXACT


@pytest.mark.parametrize("name", VECTORS)
def test_metric_weight_momenta_tool_and_torques(name):
    arm = machine_of(name)
    form = canonical(arm, [Gravity()])
    torques = inverse_dynamics(arm, [Gravity()])
    outputs = [arm.metric, arm.tool, arm.recursion.gravity(ca.DM([0, 0, -9.81])), arm.recursion.momentum(arm.v)]
    function = ca.Function("parts", [arm.q, arm.v], [ca.densify(ca.SX(output)) for output in outputs])
    rate = ca.Function("rate", [form.x, form.u], [form.rate, form["energy"]])
    for state in VECTORS[name]["states"]:
        metric, tool, weight, momentum = function(state["q"], state["v"])
        assert relative(metric.full(), state["metric"]) < EXACT
        assert relative(tool, state["tool"]) < EXACT
        assert relative(weight, state["gravity_force"]) < EXACT
        assert relative(momentum, state["momentum"]) < EXACT
        assert (
            relative(torques(state["q"], state["v"], state["given_acceleration"], []), state["inverse_dynamics"])
            < EXACT
        )
        moved, _ = rate(np.concatenate([state["q"], state["momentum"]]), state["tau"])
        assert relative(np.array(moved)[len(state["q"]) :], state["momentum_rate"]) < EXACT


@pytest.mark.parametrize(
    ("make", "name"),
    [(robots.arm_3r, "3R"), (robots.puma560, "puma"), (robots.ur5, "ur5"), (robots.panda, "panda")],
    ids=["3R", "puma", "ur5", "panda"],
)
def test_shipped_robots_are_those_of_the_vectors(make, name):
    arm = make()
    form = canonical(arm, [Gravity()])
    rate = ca.Function("rate", [form.x, form.u], [form.rate, form["tool"]])
    for state in VECTORS[name]["states"]:
        moved, tool = rate(np.concatenate([state["q"], state["momentum"]]), state["tau"])
        assert relative(np.array(moved)[len(state["q"]) :], state["momentum_rate"]) < EXACT
        assert relative(tool, state["tool"]) < EXACT


# Instructions of x' with gravity; a change that lengthens one of them is a fault.
COUNTS = {
    "3R": (109, 140, 174), "ur5": (373, 475, 703), "puma": (516, 622, 948), "panda": (1070, 1344, 2276),
}  # fmt: skip


@pytest.mark.parametrize("name", COUNTS)
def test_graphs_are_as_short_as_they_were(name):
    arm = machine_of(name)
    systems = [form(arm, [Gravity()]) for form in (canonical, lagrange, hamel)]
    counts = [ca.Function("rate", [s.x, s.u], [s.rate]).n_instructions() for s in systems]
    assert all(count <= pinned for count, pinned in zip(counts, COUNTS[name], strict=True)), counts


def check_random_tree(seed):
    rng = np.random.default_rng([2026, seed])
    joints = random_joints(rng)
    arm, engine = tree(joints), Engine(joints)
    n = len(arm.coordinates)
    systems = {(form, frame): form(arm, [Gravity()], frame) for form in FORMS for frame in (None,)}
    systems[canonical, "ldl"] = canonical(arm, [Gravity()], "ldl")
    torques = inverse_dynamics(arm, [Gravity()])
    energy = ca.Function("U", [arm.q], [arm.recursion.potential(ca.DM([0, 0, -9.81]))])
    for _ in range(2):
        q, v, tau = (rng.uniform(-2, 2, n) for _ in range(3))
        tau *= 20.0
        metric = engine.metric(q).real
        a = engine.accelerations(q, v, tau)
        assert relative(torques(q, v, a, []), tau) < 1e-9
        assert abs(float(energy(q)) - engine.potential(q)) < 1e-11 * (1.0 + abs(engine.potential(q)))
        for (form, frame), system in systems.items():
            speed, got = accelerations(system, q, state_of(form, frame, arm, q, v, metric @ v), tau)
            # An ill-conditioned metric costs both engines the same digits.
            digits = max(1.0, np.linalg.cond(metric) * 1e-3)
            assert relative(speed, v) < EXACT * digits
            assert relative(got, a) < EXACT * digits, (seed, form.__name__, frame)


@pytest.mark.parametrize("seed", range(4))
def test_random_trees(seed):
    check_random_tree(seed)


@pytest.mark.slow
def test_more_random_trees():
    for seed in range(4, 100):
        check_random_tree(seed)


def test_the_engine_of_the_tests_agrees_with_the_vectors():
    given = VECTORS["tree"]
    joints = given["joints"]
    made = []
    for joint in joints:
        t = joint["inertia"]
        entries = tuple(t[i][j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        parent = joints[joint["parent"]]["name"] if joint["parent"] >= 0 else ""
        kind = Kind.REVOLUTE if joint["kind"] == "revolute" else Kind.PRISMATIC
        link = Link(joint["mass"], joint["centre"], entries)
        made.append(
            Joint(
                joint["name"],
                kind,
                parent,
                joint["origin"],
                joint["rotation"],
                joint["axis"],
                link,
                rotor=joint["rotor"],
            )
        )
    engine = Engine(made)
    for state in given["states"]:
        assert relative(engine.metric(state["q"]).real, state["metric"]) < 1e-13
        assert (
            relative(engine.accelerations(*(np.array(state[k]) for k in ("q", "v", "tau"))), state["acceleration"])
            < 1e-11
        )
