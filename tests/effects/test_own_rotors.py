"""Elastic joints of arms whose joints have rotors of their own: the rotor sits behind the spring, not on the link."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from rigid_bodies.tree_engine import Engine

from models import Joint, Link, Parameter, robots, serial
from models.effects import ElasticDrive, Gravity, RotorInertia, Terms
from models.forms import canonical, hamel, lagrange
from models.mechanics.contributions import Sizes

LINK = Link(3.0, (0.1, 0.05, 0.2), (0.05, 0.06, 0.04, 0.003, -0.002, 0.001))
JOINTS = [
    Joint("a", link=LINK, rotor=2e-4, gear=80.0),
    Joint("b", parent="a", origin=(0.0, 0.1, 0.3), axis=(0.0, 1.0, 0.2), link=LINK, rotor=1e-4, gear=-60.0,
          carried=True),
    Joint("c", parent="b", origin=(0.3, 0.1, 0.0), axis=(1.0, 0.0, 0.2), link=LINK, rotor=1e-4, gear=50.0),
]  # fmt: skip
Q, V, TAU = np.array([0.3, -0.8, 0.5]), np.array([1.0, -0.5, 0.7]), np.array([4.0, 2.0, -3.0])
STIFF = (4e3, 3e3, None)


def accelerations(system, q, v, states, u, p=()):
    """Return dv/dt of a form at given positions and velocities."""
    n = len(q)
    slope = ca.Function("s", [system.x, system.p], [ca.jacobian(system["v"], system.x[n : 2 * n])])
    zero = np.concatenate([q, np.zeros(system.x.numel() - n)])
    x = np.concatenate([q, np.linalg.solve(slope(zero, p).full(), v), states])
    rate = ca.Function(
        "r", [system.x, system.u, system.p], [ca.jtimes(system["v"], system.x, system.rate), system.rate]
    )
    moved, whole = rate(x, u, p)
    return moved.full().ravel(), whole.full().ravel()[2 * n :]


@pytest.mark.parametrize("form", [lagrange, canonical, hamel])
@pytest.mark.parametrize("inertia", [None, (1.5, 0.7, None)], ids=["own", "given"])
def test_a_rotor_of_a_joint_sits_behind_its_spring(form, inertia):
    system = form(serial(JOINTS), [Gravity(), ElasticDrive(STIFF, inertia)])
    twist, slip = np.array([2e-3, -1e-3]), np.array([0.02, 0.05])
    states = np.stack([Q[:2] + twist, V[:2] + slip], axis=1).ravel()
    got, rates = accelerations(system, Q, V, states, TAU)
    # The engine of the tests: no rotor on elastic joints; the rigid one keeps its own.
    pull = np.array([4e3, 3e3]) * twist
    bare = [replace(joint, rotor=0.0) if joint.name != "c" else joint for joint in JOINTS]
    assert got == pytest.approx(Engine(bare).accelerations(Q, V, np.array([*pull, TAU[2]])), rel=1e-10)
    rotors = np.array([80.0**2 * 2e-4, 60.0**2 * 1e-4]) if inertia is None else np.array(inertia[:2])
    assert rates[1::2] == pytest.approx((TAU[:2] - pull) / rotors, rel=1e-12)


@pytest.mark.slow
def test_rotors_that_are_parameters_move_behind_the_spring():
    made = lambda rotor: serial([replace(joint, rotor=rotor) for joint in JOINTS])  # noqa: E731
    symbolic = canonical(made(Parameter(1e-4)), [ElasticDrive(STIFF, None)])
    numbers = canonical(made(3e-4), [ElasticDrive(STIFF, None)])
    states = np.concatenate([Q[:2] + 1e-3, V[:2]]).reshape(2, 2).T.ravel()
    one = accelerations(symbolic, Q, V, states, TAU, [3e-4] * 3)
    other = accelerations(numbers, Q, V, states, TAU)
    for got, wanted in zip(one, other, strict=True):
        assert got == pytest.approx(wanted, rel=1e-9)


def test_rotors_of_published_robots():
    arm = robots.puma560()
    assert arm.rotors == pytest.approx([62.6111**2 * 2e-4, 107.815**2 * 2e-4, 53.7063**2 * 2e-4,
                                        76.0364**2 * 33e-6, 71.923**2 * 33e-6, 76.686**2 * 33e-6])  # fmt: skip
    assert robots.manutec_r3().spins == pytest.approx([0.0, 0.0, 60 * 1.3e-3])
    assert robots.ur5().rotors == ()


def test_a_joint_without_a_rotor_needs_an_inertia():
    with pytest.raises(ValueError, match="inertia_1: got None for a joint with a stiffness and without a rotor"):
        lagrange(robots.ur5(), [ElasticDrive(1e4, None)])


def test_usual_drives_of_joints_with_rotors_keep_these():
    arm = serial(JOINTS)
    sizes = Sizes(arm, (1.0,) * 3, (1.0,) * 3)
    assert RotorInertia.typical(sizes).inertia == (None,) * 3
    assert ElasticDrive.typical(sizes).inertia == (None,) * 3
    assert not RotorInertia.typical(sizes)(arm, Terms()).metric.nnz()
    bare = Sizes(robots.ur5(), (1.0,) * 6, (1.0,) * 6)
    assert RotorInertia.typical(bare).inertia == 1e-4
    assert ElasticDrive.typical(bare).inertia == (1e-4 * 100.0**2,) * 6
