"""Friction, rotors and stops against closed solutions."""

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import NAMES, machine, relative, states

from models import Parameter, cylindrical, inverse_dynamics, spherical
from models.effects import Coulomb, JointStop, RotorInertia, Stribeck, Viscous
from models.forms import canonical, hamel, lagrange
from models.mechanics.mechanics import assemble
from ocp import simulate

EACH_FORM = pytest.mark.parametrize("form", [lagrange, hamel, canonical], ids=lambda form: form.__name__)
MASS = 65.0  # m_2 + m_3 of the lift
SPEED, FORCE = 0.8, 40.0


def lift(form, effects, speed=SPEED):
    """Return a cylindrical arm whose lift alone moves upwards, without gravity, and its state."""
    arm = cylindrical(A=0.0)
    third = MASS * speed if form is canonical else speed
    return form(arm, effects), np.array([0.0, 0.2, 0.6, 0.0, third, 0.0])


@EACH_FORM
def test_viscous_friction_lets_speed_decay(form):
    c = 90.0
    system, x = lift(form, [Viscous((7.0, c, 5.0))])
    motion = simulate(system, x, np.zeros(3), 2.0)
    assert motion.ok
    assert np.max(np.abs(motion.signal("v")[:, 1] - SPEED * np.exp(-c * motion.t / MASS))) < 1e-12
    way = SPEED * MASS / c * (1.0 - np.exp(-c * motion.t / MASS))
    assert np.max(np.abs(motion.signal("q")[:, 1] - 0.2 - way)) < 1e-12
    assert np.max(np.abs(motion.signal("loss")[:, 0] - c * motion.signal("v")[:, 1] ** 2)) < 1e-12


@EACH_FORM
def test_coulomb_friction_stops_after_the_way_and_time_of_theory(form):
    # m v' = -f tanh(v / w) has sinh(v / w) = sinh(v0 / w) exp(-f t / (m w)); w -> 0 is v = v0 - f t / m.
    time, way = MASS * SPEED / FORCE, MASS * SPEED**2 / (2.0 * FORCE)
    errors = []
    for width in (0.08, 0.04, 0.02):
        system, x = lift(form, [Coulomb(FORCE, width)])
        motion = simulate(system, x, np.zeros(3), np.linspace(0.0, 3.0 * time, 121))
        assert motion.ok
        exact = width * np.arcsinh(np.sinh(SPEED / width) * np.exp(-FORCE * motion.t / (MASS * width)))
        assert np.max(np.abs(motion.signal("v")[:, 1] - exact)) < 1e-10
        errors.append(motion.signal("q")[-1, 1] - 0.2 - way)
        # At the time of the sharp law the speed is that of sinh(v / w) = 1/2, and falls like exp(-f t / (m w)).
        at_stop = simulate(system, x, np.zeros(3), [time]).signal("v")[0, 1]
        assert at_stop == pytest.approx(width * np.arcsinh(0.5), rel=1e-6)
        assert motion.signal("v")[-1, 1] < SPEED * np.exp(-(SPEED / width))
    assert errors == pytest.approx([np.pi**2 / 12.0 * MASS * w**2 / FORCE for w in (0.08, 0.04, 0.02)], rel=1e-4)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.01)


def test_coulomb_friction_creeps_as_documented():
    push, width = 0.6 * FORCE, 0.02
    system, x = lift(lagrange, [Coulomb(FORCE, width)], speed=0.0)
    motion = simulate(system, x, [0.0, push, 0.0], 1.0)
    assert motion.signal("v")[-1, 1] == pytest.approx(width * np.arctanh(push / FORCE), rel=1e-6)
    speed = 2.65 * width
    (force,) = lift_force([Coulomb(FORCE, width)], [speed])
    assert 0.0 < FORCE - force < 0.01 * FORCE


def lift_force(effects, v):
    """Return the force of the lift drive at constant speeds."""
    columns = np.zeros((3, len(v)))
    columns[1] = v
    torques = inverse_dynamics(cylindrical(A=0.0), effects).map(len(v))
    return np.array(torques(np.full((3, len(v)), 0.5), columns, 0.0 * columns, np.zeros((0, len(v)))))[1]


def test_stribeck_friction_has_its_curve():
    f, static, speed, width = 20.0, 30.0, 0.1, 0.01
    effects = [Stribeck(f, static, speed, width)]
    v = np.linspace(0.03, 1.0, 50)  # beyond the smoothing
    expected = f + (static - f) * np.exp(-((v / speed) ** 2))
    assert np.max(np.abs(lift_force(effects, v) - expected)) < static * 2.0 * np.exp(-6.0)
    near = lift_force(effects, np.linspace(0.0, 0.1, 4001))
    assert np.max(near) / static == pytest.approx(0.97, abs=0.005)  # as the docstring says
    assert lift_force(effects, [-0.4]) == pytest.approx(-lift_force(effects, [0.4]))


@EACH_FORM
def test_all_losses_come_from_the_energy(form):
    arm = spherical()
    system = form(arm, [Viscous(0.8), Coulomb((2.0, 2.0, 0.05, 5.0), 0.1), JointStop(upper=(None, 0.5, None, None))])
    spent = ca.SX.sym("spent")
    counted = type(system)(ca.vertcat(system.x, spent), system.u, system.p, ca.vertcat(system.rate, system["loss"]))
    q, v, _ = states(arm, 1, seed=3)
    third = assemble(arm, []).frame(None)
    x = q[:, 0].copy(), v[:, 0] / 2.0
    w = np.array(ca.Function("w", [arm.q], [third.matrix])(x[0])) @ x[1]
    if form is canonical:
        w = np.array(ca.Function("g", [arm.q], [third.metric])(x[0])) @ w
    start = np.append(x[0], x[1] if form is lagrange else w)
    motion = simulate(counted, np.append(start, 0.0), np.zeros(4), 1.0)
    energy = np.array([float(ca.Function("E", [system.x], [system["energy"]])(row[:-1])) for row in motion.x])
    assert motion.ok
    assert energy[0] - energy[-1] > 0.05 * energy[0]
    assert np.max(np.abs(energy + motion.x[:, -1] - energy[0])) < 1e-9 * energy[0]


@pytest.mark.parametrize("name", NAMES)
def test_rotors_are_reflected_with_the_square_of_the_ratio(name):
    arm = machine(name)
    n = len(arm.coordinates)
    inertia, ratio = np.linspace(1e-4, 3e-4, n), np.linspace(60.0, 140.0, n)
    rng = np.random.default_rng(3)
    coupling = np.eye(n) + 0.3 * rng.uniform(-1, 1, (n, n))
    for matrix, effect in (
        (np.eye(n), RotorInertia(tuple(inertia), tuple(ratio))),
        (coupling, RotorInertia(tuple(inertia), tuple(ratio), coupling.tolist())),
    ):
        q, v, a = states(arm, 30, seed=2)
        bare, whole = (np.array(inverse_dynamics(arm, e).map(30)(q, v, a, np.zeros((0, 30)))) for e in ([], [effect]))
        # By the rotors: each turns with W = N C v and needs J dW/dt, handed back through the gear.
        expected = matrix.T @ (ratio[:, None] * inertia[:, None] * (ratio[:, None] * (matrix @ a)))
        assert relative(whole - bare, expected, np.max(np.abs(whole), axis=0)) < 1e-13


@pytest.mark.parametrize("name", NAMES)
def test_systems_name_the_effect_that_couples_the_metric(name):
    arm = machine(name)
    plain, none = canonical(arm), canonical(arm, [RotorInertia(0.0), Viscous(1.0)])
    assert none.notes == plain.notes
    notes = canonical(arm, [Viscous(1.0), RotorInertia(2e-4)]).notes
    if name == "cylinder_centred":
        assert notes == ()  # A = 0: the coordinates themselves are orthogonal
        return
    (note,) = notes
    with_it, without = (
        ca.Function("f", [s.x, s.u], [s.rate]).n_instructions()
        for s in (canonical(arm, [Viscous(1.0), RotorInertia(2e-4)]), canonical(arm, [Viscous(1.0)]))
    )
    assert f"the effect rotor_inertia (for {with_it - without} of {with_it} instructions)" in note
    assert ("the parameters of the machine" in note) == bool(plain.notes)
    assert "viscous" not in note


def test_friction_of_parameters():
    arm = spherical()
    system = canonical(arm, [Viscous(Parameter(0.7)), Coulomb((Parameter(1.0), 2.0, Parameter(0.1), 4.0))])
    assert system.nominal == {"viscous.c": 0.7, "coulomb.f_1": 1.0, "coulomb.f_3": 0.1}
    numbers = canonical(arm, [Viscous(0.9), Coulomb((1.5, 2.0, 0.2, 4.0))])
    q, third, u = states(arm, 10)
    x = np.vstack([q, third])
    given = ca.Function("f", [system.x, system.u, system.p], [system.rate]).map(10)(
        x, u, np.tile([[0.9], [1.5], [0.2]], 10)
    )
    folded = ca.Function("f", [numbers.x, numbers.u], [numbers.rate]).map(10)(x, u)
    assert relative(np.array(given), np.array(folded)) < 1e-13


@pytest.mark.slow
@EACH_FORM
def test_stop_turns_a_joint_back_and_keeps_what_it_does_not_damp(form):
    stiffness, end = 4e4, 0.4
    for damping in (0.0, 0.3):
        system, x = lift(form, [JointStop(upper=(None, end, None), stiffness=stiffness, damping=damping, width=1e-5)])
        motion = simulate(system, x, np.zeros(3), np.linspace(0.0, 0.7, 1401))
        assert motion.ok
        speed, place = motion.signal("v")[:, 1], motion.signal("q")[:, 1]
        if damping == 0.0:
            # Half an oscillation of the lift on the spring: depth v0 sqrt(m / k), time pi sqrt(m / k).
            assert np.max(place) - end == pytest.approx(SPEED * np.sqrt(MASS / stiffness), rel=2e-3)
            assert speed[-1] == pytest.approx(-SPEED, rel=1e-6)
            energy = motion.signal("energy")[:, 0]
            assert np.max(np.abs(energy - MASS * SPEED**2 / 2.0)) < 1e-6 * energy[0]
            assert np.max(np.abs(motion.signal("loss"))) < 1e-9 * MASS * SPEED**3
            beyond = np.sum(place > end) * 0.7 / 1400
            assert beyond == pytest.approx(np.pi * np.sqrt(MASS / stiffness), rel=0.02)
        else:
            # m v dv = -k e (1 + d v) de: v / d - ln(1 + d v) / d^2 = -k e^2 / (2 m) + const, the same before and after.
            level = speed[-1] / damping - np.log(1.0 + damping * speed[-1]) / damping**2
            assert level == pytest.approx(SPEED / damping - np.log(1.0 + damping * SPEED) / damping**2, rel=1e-3)
            assert -SPEED < speed[-1] < -0.5 * SPEED


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_stop_is_as_smooth_as_documented(sign):
    width, stiffness, end = 0.01, 1000.0, 0.3 * sign
    sides = {"upper" if sign > 0.0 else "lower": (None, end, None)}
    torque = inverse_dynamics(cylindrical(A=0.0), [JointStop(**sides, stiffness=stiffness, damping=0.0, width=width)])
    for e in (-0.2, -0.05, 0.05, 0.2):
        force = float(torque([0, end + sign * e, 0.5], [0, 0, 0], [0, 0, 0], [])[1])
        excess = sign * force / stiffness - max(e, 0.0)
        assert excess == pytest.approx(width**2 / (4.0 * abs(e)), rel=0.011)
    at_end = float(torque([0, end, 0.5], [0] * 3, [0] * 3, [])[1])
    assert at_end == pytest.approx(sign * stiffness * width / 2.0)
