"""Rotors that turn with the links that carry them, against rotors as bodies of their own that share no code."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import NAMES, evaluate, machine, relative, states
from rigid_bodies.tree_engine import Engine, random_joints

from models import Joint, Kind, Link, Parameter, inverse_dynamics, robots, split_torques, tree
from models.effects import Gravity, Payload, RotorInertia
from models.forms import canonical, hamel, lagrange

# joint -> body that carries its rotor and the axis in its axes, as the machines are described; the first one has none
CARRIERS = {
    "cylindrical": {"xi": ("column", (0, 0, 1)), "r": ("carriage", (0, 1, 0))},
    "spherical": {"theta": ("column", (-1, 0, 0)), "phi": ("swivel", (0, 0, 1)), "r": ("arm", (0, 0, 1))},
    "torus": {"q2": ("column", (0, -1, 0)), "q3": ("link 2", (0, -1, 0))},
}


def rotor_energy(arm, inertia, ratio):
    """Return the kinetic energy of the rotors less that of their part which turns with the links."""
    bodies, total = {body.name: body for body in arm.bodies}, 0
    for k, coordinate in enumerate(arm.coordinates):
        spin = ratio[k] * arm.v[k]
        carrier = CARRIERS[arm.name].get(coordinate.name)
        if carrier is not None:
            turned = bodies[carrier[0]].orientation
            rate = ca.reshape(ca.jacobian(ca.vec(ca.densify(turned)), arm.q) @ arm.v, 3, 3)
            omega = ca.inv_skew((rate @ turned.T - turned @ rate.T) / 2)
            about = ca.dot(turned @ ca.DM(carrier[1]), omega)
            total += inertia[k] * ((spin + about) ** 2 - about**2) / 2
        else:
            total += inertia[k] * spin**2 / 2
    return total


@pytest.mark.parametrize("name", NAMES)
def test_rotors_of_the_machines_turn_with_their_carriers(name):
    arm = machine(name)
    n = len(arm.coordinates)
    q, v, a = states(arm, 20, seed=3)
    inertia, ratio = [2e-4, 3e-4, 1e-4, 4e-4][:n], [80.0, -60.0, 120.0, 90.0][:n]
    kinetic, symbol = rotor_energy(arm, inertia, ratio), ca.SX.sym("a", n)
    momentum = ca.gradient(kinetic, arm.v)
    needed = ca.jacobian(momentum, arm.v) @ symbol + ca.jtimes(momentum, arm.q, arm.v) - ca.gradient(kinetic, arm.q)
    (expected,) = evaluate([arm.q, arm.v, symbol], [needed], q, v, a)
    rotors = RotorInertia(inertia, ratio, carried=True)
    torques = [
        np.array(inverse_dynamics(arm, effects).map(20)(q, v, a, np.zeros((0, 20))))
        for effects in ([Gravity(), rotors], [Gravity()])
    ]
    assert relative(torques[0] - torques[1], expected, np.max(np.abs(expected), axis=0)) < 1e-10


class Rotors(Engine):
    """An engine with rotors as bodies that turn on their links: (joint, J about the axis, J across, ratio)."""

    def __init__(self, joints, rotors):
        super().__init__(joints)
        self.rotors = rotors

    def metric(self, q):
        total = super().metric(q)
        axes = self.frames(q)[1]
        n = len(self.moving)
        spins = np.zeros((len(self.joints), 3, n), dtype=complex)
        for i, joint in enumerate(self.joints):
            if self.parents[i] >= 0:
                spins[i] = spins[self.parents[i]]
            if joint.kind is Kind.REVOLUTE:
                spins[i, :, self.moving.index(i)] += axes[i]
        for i, own, across, ratio in self.rotors:
            axis, k = axes[i], self.moving.index(i)
            tensor = across * np.eye(3) + (own - across) * np.outer(axis, axis)
            carried = spins[self.parents[i]] if self.parents[i] >= 0 else np.zeros((3, n))
            turning = carried.copy()
            turning[:, k] += ratio * axis
            total += turning.T @ tensor @ turning - carried.T @ tensor @ carried  # the rest is part of the link
        return total


def check_tree(seed):
    rng = np.random.default_rng([9, seed])
    joints = [replace(joint, rotor=0.0, carried=False) for joint in random_joints(rng)]
    moving = [i for i, joint in enumerate(joints) if joint.kind is not Kind.FIXED]
    n = len(moving)
    inertia, ratio = rng.uniform(1e-4, 5e-4, n), rng.uniform(-120, 120, n)
    engine = Rotors(joints, [(i, inertia[k], 0.6 * inertia[k], ratio[k]) for k, i in enumerate(moving)])
    effects = [Gravity(), RotorInertia(tuple(inertia), tuple(ratio), carried=True)]
    arm = tree(joints)
    q, v, tau = (rng.uniform(-1.5, 1.5, n) for _ in range(3))
    expected = engine.accelerations(q, v, tau)
    digits = max(1.0, np.linalg.cond(engine.metric(q).real) * 1e-3)
    for form in (lagrange, canonical, hamel):
        system = form(arm, effects)
        outputs = [
            system["v"],
            ca.jacobian(system["v"], system.x[n:]),
            ca.jacobian(system["v"], system.x) @ system.rate,
        ]
        function = ca.Function("f", [system.x, system.u], [ca.densify(output) for output in outputs])
        # v is linear in the second half of the state.
        slope = function(np.concatenate([q, np.zeros(n)]), tau)[1].full()
        state = np.concatenate([q, np.linalg.solve(slope, v)])
        speed, _, a = (part.full() for part in function(state, tau))
        assert np.max(np.abs(speed.ravel() - v)) < 1e-12 * digits, seed
        assert np.max(np.abs(a.ravel() - expected)) < 1e-11 * digits * max(np.max(np.abs(expected)), 1.0), seed
        if form is canonical:
            assert np.max(np.abs(state[n:] - engine.metric(q).real @ v)) < 1e-11 * digits, seed


def test_rotors_of_random_trees_turn_with_their_carriers():
    for seed in range(1):
        check_tree(seed)


@pytest.mark.slow
def test_rotors_of_more_random_trees_turn_with_their_carriers():
    for seed in range(1, 25):
        check_tree(seed)


def test_rotors_of_the_manutec_are_those_of_its_joints():
    arm = robots.manutec_r3()
    bare = tuple(replace(joint, rotor=0.0, spin=0.0) for joint in arm.recursion.tree.joints)
    recursion = replace(arm.recursion, tree=replace(arm.recursion.tree, joints=bare))
    rotors = RotorInertia(1.3e-3, (-105.0, 210.0, 60.0), carried=(False, False, True))
    plain = replace(arm, recursion=recursion, metric=recursion.metric)
    rng = np.random.default_rng(8)
    one, other = inverse_dynamics(plain, [Gravity(), rotors]), inverse_dynamics(arm, [Gravity()])
    for _ in range(3):
        q, v, a = (rng.uniform(-2, 2, 3) for _ in range(3))
        assert np.allclose(one(q, v, a, []).full(), other(q, v, a, []).full(), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("name", ["sphere", "torus_offset", "3R"])
def test_rotors_loads_and_torques_by_cause_go_together(name):
    arm = robots.arm_3r() if name == "3R" else machine(name)
    n = len(arm.coordinates)
    effects = [Gravity(), Payload(Parameter(3.0), (0.1, 0.0, 0.05)), RotorInertia(Parameter(2e-4), 80.0, carried=True)]
    rng = np.random.default_rng(9)
    q, v, a = (rng.uniform(0.3, 1.2, n) for _ in range(3))
    parts = split_torques(arm, effects)
    whole = inverse_dynamics(arm, effects)(q, v, a, [3.0, 2e-4]).full()
    assert np.allclose(sum(part.full() for part in parts(q, v, a, [3.0, 2e-4])), whole, rtol=1e-12, atol=1e-9)
    system = canonical(arm, effects)
    rate = ca.Function("f", [system.x, system.u, system.p], [system["energy"], system["power"],
                       ca.jacobian(system["energy"], system.x) @ system.rate])  # fmt: skip
    _, power, change = (float(part) for part in rate(np.concatenate([q, v]), np.arange(n) + 1.0, [3.0, 2e-4]))
    assert change == pytest.approx(power, rel=1e-9)


def test_rotors_that_are_refused():
    with pytest.raises(ValueError, match="carried: given together with a coupling"):
        RotorInertia(1e-4, coupling=[[1.0, 0.0], [0.0, 1.0]], carried=True)
    with pytest.raises(ValueError, match="got 2 values, 3R arm has 3 drives"):
        canonical(robots.arm_3r(), [RotorInertia(1e-4, carried=(True, False))])
    with pytest.raises(ValueError, match="does not say which link carries which joint"):
        canonical(replace(robots.arm_3r(), recursion=None), [RotorInertia(1e-4, carried=True)])
    with pytest.raises((ValueError, TypeError), match="carried"):
        RotorInertia(1e-4, carried=1.5)
    only = tree([Joint("q", link=Link(1.0, inertia=(0.1, 0.1, 0.1)))])  # the base does not turn
    counts = [ca.Function("f", [s.x, s.u], [s.rate]).n_instructions()
              for s in (canonical(only, [RotorInertia(1e-4, carried=one)]) for one in (True, False))]  # fmt: skip
    assert counts[0] == counts[1]
