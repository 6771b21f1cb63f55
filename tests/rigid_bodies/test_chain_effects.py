"""Every effect on arms of links: the recursion against the same arm with its metric and bodies written out."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from catalogue.effect_cases import CASES
from rigid_bodies.tree_engine import Engine

from models import Joint, Kind, Link, Parameter, inverse_dynamics, robots, serial, split_torques, tree
from models.effects import Counterbalance, Gravity, Payload, RotorInertia, Viscous
from models.forms import canonical, hamel, lagrange

FORMS = (canonical, hamel, lagrange)


@cache
def arm_of(name):
    if name == "branched":
        link = Link(3.0, (0.1, 0.05, 0.2), (0.05, 0.06, 0.04, 0.003, -0.002, 0.001))
        joints = [
            Joint("base", link=link),
            Joint("tool arm", parent="base", origin=(0.0, 0.1, 0.3), axis=(0.0, 1.0, 0.0), link=link),
            Joint(
                "slide",
                Kind.PRISMATIC,
                "base",
                origin=(0.2, 0.0, 0.1),
                axis=(1.0, 0.0, 0.3),
                link=link,
                rotor=1e-3,
                gear=30,
            ),
        ]
        return tree(joints, tip="tool arm", tool=(0.3, 0.0, 0.1), tool_rotation=(0.3, -0.4, 0.5))
    return robots.arm_3r()


@cache
def written_out(name):
    """Return the arm without its recursion: metric, bodies and tool as expressions."""
    return replace(arm_of(name), recursion=None, frames=dict(arm_of(name).frames))


def difference(one, other):
    one, other = np.array(one).ravel(), np.array(other).ravel()
    return np.max(np.abs(one - other)) / max(np.max(np.abs(other)), 1e-9)


@pytest.mark.parametrize("name", ["3R", "branched"])
@pytest.mark.parametrize("case", CASES)
def test_every_effect_acts_as_on_the_arm_written_out(case, name):
    arm, plain = arm_of(name), written_out(name)
    n = len(arm.coordinates)
    rng = np.random.default_rng(len(case))
    for form in FORMS:
        frame = "coordinate" if form is canonical else "innovations"
        systems = [form(one, CASES[case](n), frame) for one in (arm, plain)]
        p = list(systems[0].nominal.values())
        x, u = rng.uniform(-0.6, 0.9, systems[0].x.numel()), rng.uniform(-5, 5, systems[0].u.numel())
        assert set(systems[0].signals) - {"rest"} == set(systems[1].signals) - {"rest"}
        for output in ("rate", *(name for name in systems[1].signals if name != "rest")):
            values = [
                ca.Function("f", [s.x, s.u, s.p], [s.rate if output == "rate" else s[output]])(x, u, p).full()
                for s in systems
            ]
            assert difference(*values) < 1e-9, (form.__name__, output)


def test_a_load_is_the_inertia_of_the_last_link():
    # The same load as a link that is fixed to the last joint.
    joints = [
        Joint("q1", link=Link(5.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.05))),
        Joint("q2", axis=(0.0, 1.0, 0.0), origin=(0.0, 0.0, 0.4), link=Link(4.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.02))),
    ]
    load = Link(2.5, (0.03, -0.05, 0.1), (0.02, 0.03, 0.015, 0.001, 0.002, -0.001))
    arm = serial(joints, tool=(0.1, 0.0, 0.5))
    with_link = serial([*joints, Joint("load", Kind.FIXED, origin=(0.1, 0.0, 0.5), link=load)], tool=(0.0, 0.0, 0.0))
    loaded = [Gravity(), Payload(load.mass, load.centre, load.inertia)]
    one, other = inverse_dynamics(arm, loaded), inverse_dynamics(with_link, [Gravity()])
    rng = np.random.default_rng(4)
    for _ in range(5):
        q, v, a = (rng.uniform(-2, 2, 2) for _ in range(3))
        assert difference(one(q, v, a, []), other(q, v, a, [])) < 1e-13
    counts = [ca.Function("f", [s.x, s.u], [s.rate]).n_instructions()
              for s in (canonical(arm, loaded), canonical(with_link, [Gravity()]))]  # fmt: skip
    assert counts[0] == counts[1]


def test_a_symbolic_load_follows_its_parameter():
    arm = robots.arm_3r()
    symbolic = canonical(arm, [Gravity(), Payload(Parameter(1.0), (0.1, 0.0, 0.0))])
    numbers = canonical(arm, [Gravity(), Payload(3.0, (0.1, 0.0, 0.0))])
    x, u = np.linspace(-0.5, 0.7, 6), [1.0, 2.0, 3.0]
    one = ca.Function("f", [symbolic.x, symbolic.u, symbolic.p], [symbolic.rate])(x, u, [3.0])
    other = ca.Function("f", [numbers.x, numbers.u], [numbers.rate])(x, u)
    assert list(symbolic.nominal) == ["payload.mass"]
    assert difference(one, other) < 1e-13


def test_parameters_of_links_stay_symbols():
    made = lambda mass, length: serial([  # noqa: E731
        Joint("q1", link=Link(mass, (0.0, 0.0, 0.2), (0.1, 0.1, 0.05))),
        Joint("q2", axis=(0.0, 1.0, 0.0), origin=(0.1, 0.0, length), link=Link(4.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.02))),
    ], tool=(0.0, 0.0, 0.3))  # fmt: skip
    symbolic = canonical(made(Parameter(5.0), Parameter(0.4)), [Gravity()])
    numbers = canonical(made(7.0, 0.55), [Gravity()])
    assert list(symbolic.nominal) == ["q1.mass", "q2.origin_3"]
    x, u = [0.3, -0.7, 0.4, 0.2], [1.0, 2.0]
    values = ca.Function(
        "f", [symbolic.x, symbolic.u, symbolic.p], [symbolic.rate, symbolic["tool"], symbolic["energy"]]
    )
    wanted = ca.Function("f", [numbers.x, numbers.u], [numbers.rate, numbers["tool"], numbers["energy"]])
    for got, want in zip(values(x, u, [7.0, 0.55]), wanted(x, u), strict=True):
        assert difference(got, want) < 1e-13


def test_rotors_of_effects_are_those_of_joints():
    joints = [
        Joint("q1", link=Link(5.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.05))),
        Joint("q2", axis=(0.0, 1.0, 0.0), origin=(0.0, 0.0, 0.4), link=Link(4.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.02))),
    ]
    turning = [replace(joint, rotor=2e-4, gear=80.0) for joint in joints]
    rng = np.random.default_rng(5)
    one = inverse_dynamics(serial(joints), [Gravity(), RotorInertia(2e-4, 80.0)])
    other = inverse_dynamics(serial(turning), [Gravity()])
    for _ in range(3):
        q, v, a = (rng.uniform(-2, 2, 2) for _ in range(3))
        assert difference(one(q, v, a, []), other(q, v, a, [])) < 1e-13


def test_manutec_couples_joints_two_and_three_through_a_rotor():
    arm = robots.manutec_r3()
    metric = ca.Function("m", [arm.q], [ca.densify(arm.metric)])([0.3, 0.4, np.pi / 2]).full()
    bare = ca.Function("m", [arm.q], [ca.densify(replace_rotor(arm))])([0.3, 0.4, np.pi / 2]).full()
    change = metric - bare
    assert change[1, 2] == pytest.approx(60 * 1.3e-3, rel=1e-12)
    assert np.diag(change) == pytest.approx([105**2 * 1.3e-3, 210**2 * 1.3e-3, 60**2 * 1.3e-3], rel=1e-12)


def replace_rotor(arm):
    """Return the metric without rotors."""
    tree_of = arm.recursion.tree
    bare = tuple(replace(joint, rotor=0.0, spin=0.0) for joint in tree_of.joints)
    return replace(arm.recursion, tree=replace(tree_of, joints=bare)).metric


def test_torques_split_by_cause_add_up():
    arm = robots.puma560()
    effects = [Gravity(), Payload(2.0, (0.0, 0.0, 0.1)), Viscous(1.5), Counterbalance(mass=3.0, at=(0.0, 0.1, -0.2))]
    rng = np.random.default_rng(6)
    q, v, a = (rng.uniform(-1, 1, 6) for _ in range(3))
    parts = split_torques(arm, effects)
    values = [part.full().ravel() for part in parts(q, v, a, [])]
    whole = inverse_dynamics(arm, effects)(q, v, a, []).full().ravel()
    assert parts.name_out() == ["inertia", "coriolis", "gravity", "payload", "viscous", "counterbalance"]
    assert difference(sum(values), whole) < 1e-12


def test_engine_and_effects_agree_on_a_load():
    joints = [
        Joint("q1", link=Link(5.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.05))),
        Joint(
            "q2",
            parent="q1",
            axis=(0.0, 1.0, 0.0),
            origin=(0.0, 0.0, 0.4),
            link=Link(4.0, (0.0, 0.0, 0.2), (0.1, 0.1, 0.02)),
        ),
    ]
    arm = serial(joints, tool=(0.0, 0.0, 0.5))
    load = Joint("load", Kind.FIXED, "q2", (0.0, 0.0, 0.5), link=Link(2.0))
    engine = Engine([*joints, load])
    q, v, tau = np.array([0.3, 0.8]), np.array([1.0, -0.5]), np.array([4.0, 2.0])
    system = lagrange(arm, [Gravity(), Payload(2.0)])
    got = ca.Function("f", [system.x, system.u], [system.rate])(np.concatenate([q, v]), tau).full().ravel()[2:]
    assert difference(got, engine.accelerations(q, v, tau)) < 1e-12
