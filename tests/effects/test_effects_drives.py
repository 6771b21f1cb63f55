"""Drives with a lag, elastic joints, electric motors and their heat against closed solutions and simpler models."""

import casadi as ca
import numpy as np
import pytest

from models import Parameter, cylindrical, drive_dynamics, spherical
from models.effects import (
    Coulomb,
    ElasticDrive,
    Gravity,
    LaggedDrive,
    MotorDrive,
    RotorInertia,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.forms import canonical, hamel, lagrange
from ocp import Fixed, Problem, along, extend, point_to_point, simulate, start

EACH_FORM = pytest.mark.parametrize("form", [lagrange, hamel, canonical], ids=lambda form: form.__name__)
MASS = 65.0  # of the lift, m_2 + m_3
LIFT = 1


def lift(form, effects, machine=None, **extra):
    """Return a cylindrical arm of which the lift moves, without gravity, and its state at rest at 0.2 m."""
    arm = cylindrical(A=0.0) if machine is None else machine
    system = form(arm, effects)
    x = np.zeros(system.x.numel())
    x[:3] = 0.0, 0.2, 0.6
    for i, label in enumerate(system.labels["x"]):
        if label.name in extra:
            x[i] = extra[label.name]
        elif label.name.startswith("motor_q_"):
            x[i] = x[[c.name for c in arm.coordinates].index(label.name.removeprefix("motor_q_"))]
        elif label.name.startswith("winding"):
            x[i] = 293.15
    return system, x


@EACH_FORM
def test_lagged_drive_answers_a_step_like_a_lag_of_first_order(form):
    constant, command = 0.05, 130.0
    system, x = lift(form, [LaggedDrive((None, constant, None))])
    motion = simulate(system, x, [0.0, command, 0.0], 0.4)
    t = motion.t
    assert motion.ok
    assert [label.name for label in system.labels["u"]] == ["command_phi", "command_xi", "command_r"]
    assert [str(label) for label in system.labels["x"][6:]] == ["drive_tau_xi [N]"]
    assert np.max(np.abs(motion.signal("tau")[:, LIFT] - command * (1.0 - np.exp(-t / constant)))) < 1e-10
    speed = command / MASS * (t - constant * (1.0 - np.exp(-t / constant)))
    assert np.max(np.abs(motion.signal("v")[:, LIFT] - speed)) < 1e-12
    assert np.max(np.abs(motion.signal("K_xi") - motion.signal("tau")[:, [LIFT]])) == 0.0


@EACH_FORM
def test_lag_goes_to_the_ideal_drive(form):
    force = lambda t: np.array([0.0, 100.0 * np.sin(3.0 * t), 0.0])  # noqa: E731
    ideal = simulate(*lift(form, []), force, 1.0).signal("q")[:, LIFT]
    errors = []
    for constant in (0.02, 0.01, 0.005):
        late = simulate(*lift(form, [LaggedDrive(constant)]), force, 1.0)
        errors.append(np.max(np.abs(late.signal("q")[:, LIFT] - ideal)))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.05)


@EACH_FORM
def test_elastic_joint_swings_with_its_eigenfrequency(form):
    stiffness, inertia = 8e4, 12.0
    frequency = np.sqrt(stiffness * (1.0 / inertia + 1.0 / MASS))  # motor and load against each other
    system, x = lift(form, [ElasticDrive((None, stiffness, None), inertia)], motor_q_xi=0.201)
    times = np.linspace(0.0, 20.0 * np.pi / frequency, 101)
    motion = simulate(system, x, np.zeros(3), times)
    assert motion.ok
    twist = motion.signal("motor_q")[:, LIFT] - motion.signal("q")[:, LIFT]
    assert np.max(np.abs(twist - 1e-3 * np.cos(frequency * times))) < 1e-11
    assert np.max(np.abs(motion.signal("tau")[:, LIFT] - stiffness * twist)) < 1e-9
    energy = motion.signal("energy")[:, 0]
    assert np.max(np.abs(energy / (0.5 * stiffness * 1e-6) - 1.0)) < 1e-9
    # With the motor held, the load swings alone.
    held, x = lift(form, [ElasticDrive((None, stiffness, None), 1e12)], motor_q_xi=0.201)
    alone = simulate(held, x, np.zeros(3), times).signal("q")[:, LIFT]
    assert np.max(np.abs(alone - 0.201 + 1e-3 * np.cos(np.sqrt(stiffness / MASS) * times))) < 1e-10


def test_damped_elastic_joint_loses_what_its_damper_takes():
    stiffness, inertia, damping = 8e4, 12.0, 150.0
    system, x = lift(lagrange, [ElasticDrive((None, stiffness, None), inertia, damping)], motor_q_xi=0.201)
    motion = simulate(system, x, np.zeros(3), np.linspace(0.0, 0.2, 201))
    reduced = inertia * MASS / (inertia + MASS)
    rate = np.sqrt(stiffness / reduced - (damping / (2 * reduced)) ** 2)
    decay = damping / (2.0 * reduced)
    twist = 1e-3 * np.exp(-decay * motion.t) * (np.cos(rate * motion.t) + decay / rate * np.sin(rate * motion.t))
    got = motion.signal("motor_q")[:, LIFT] - motion.signal("q")[:, LIFT]
    assert np.max(np.abs(got - twist)) < 1e-11
    spent = motion.signal("energy")[0, 0] - motion.signal("energy")[-1, 0]
    assert np.trapezoid(motion.signal("loss")[:, 0], motion.t) == pytest.approx(spent, rel=1e-3)


@EACH_FORM
def test_stiff_joints_go_to_rigid_ones_with_rotors(form):
    arm = spherical()
    inertia = (0.8, 0.6, 0.02, 5.0)
    rigid = form(arm, [Gravity(), ElasticDrive((None,) * 4, inertia)])
    same = form(arm, [Gravity(), RotorInertia(inertia, 1.0)])
    assert rigid.x.numel() == 8
    # A motion that starts without a jump of the torque: the motors start with the deflection of the static torque.
    q0 = np.array([1.1, 0.2, 0.3, 0.8])
    hold = np.array(
        ca.Function("t", [], [drive_dynamics(arm, [Gravity()])(q0, np.zeros(4), np.zeros(4), [])[0]])()["o0"]
    )
    push = lambda t: hold[:, 0] + np.array([20.0, 15.0, 0.3, 60.0]) * np.sin(2.0 * t) ** 4  # noqa: E731
    x0 = np.concatenate([q0, np.zeros(4)])
    ideal, twin = (simulate(system, x0, push, [0.4]).signal("q")[-1] for system in (rigid, same))
    assert np.max(np.abs(ideal - twin)) < 1e-11
    errors = []
    for squared in (1e4, 2e4, 4e4):  # of the eigenfrequencies of the motors
        stiffness = squared * np.array(inertia)
        soft = form(arm, [Gravity(), ElasticDrive(tuple(stiffness), inertia)])
        x = np.concatenate([x0, np.column_stack([q0 + hold[:, 0] / stiffness, np.zeros(4)]).ravel()])
        errors.append(np.max(np.abs(simulate(soft, x, push, [0.4], rtol=1e-10).signal("q")[-1] - ideal)))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.15)


K, R, L, N, C = 0.12, 0.9, 3e-3, 80.0, 400.0


@EACH_FORM
@pytest.mark.parametrize("inductance", [L, 0.0])
def test_motor_runs_up_to_its_steady_state(form, inductance):
    voltage = 24.0
    system, x = lift(form, [MotorDrive((None, K, None), R, inductance, N), Viscous(C)])
    motion = simulate(system, x, [0.0, voltage, 0.0], np.linspace(0.0, 3.0, 601))
    gain = K * N
    speed = gain * voltage / (R * C + gain**2)
    assert motion.ok
    assert system.x.numel() == (7 if inductance else 6)
    assert [str(label) for label in system.labels["u"]] == ["tau_phi [N m]", "voltage_xi [V]", "tau_r [N]"]
    assert motion.signal("v")[-1, LIFT] == pytest.approx(speed, rel=1e-6)
    assert motion.signal("current")[-1, LIFT] == pytest.approx(C * speed / gain, rel=1e-6)
    # Voltage times current goes into heat, the field of the coil and the mechanism.
    drawn = motion.signal("electrical_power") - motion.signal("copper_loss")[:, [LIFT]] - motion.signal("power")
    coil = ca.jtimes(inductance / 2.0 * ca.sumsqr(system["current"]), system.x, system.rate)
    assert np.max(np.abs(drawn - motion.signal(coil) if inductance else drawn)) < 1e-9
    if not inductance:
        decay = (gain**2 / R + C) / MASS
        assert np.max(np.abs(motion.signal("v")[:, LIFT] - speed * (1.0 - np.exp(-decay * motion.t)))) < 1e-12


def test_inductance_goes_to_none():
    voltage = lambda t: np.array([0.0, 24.0 * np.sin(3.0 * t), 0.0])  # noqa: E731
    runs = {}
    for inductance in (0.0, 4e-3, 2e-3, 1e-3):
        system, x = lift(canonical, [MotorDrive((None, K, None), R, inductance, N), Viscous(C)])
        runs[inductance] = simulate(system, x, voltage, 0.5).signal("q")[:, LIFT]
    errors = [np.max(np.abs(runs[value] - runs[0.0])) for value in (4e-3, 2e-3, 1e-3)]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([1.0, 1.0], abs=0.05)


def test_current_of_a_held_motor_rises_like_a_lag_and_behind_springs_it_has_the_motor_speed():
    # The load is so heavy that it stands still; the motor behind the spring turns with the motor's own speed.
    heavy = cylindrical(A=0.0, m_2=1e9)
    system, x = lift(lagrange, [MotorDrive((None, K, None), R, L, N)], heavy)
    motion = simulate(system, x, [0.0, 24.0, 0.0], 0.02)
    assert np.max(np.abs(motion.signal("current")[:, LIFT] - 24.0 / R * (1.0 - np.exp(-R / L * motion.t)))) < 1e-6
    system, x = lift(lagrange, [MotorDrive((None, K, None), R, 0.0, N), ElasticDrive((None, 1e-6, None), 15.0)], heavy)
    motion = simulate(system, x, [0.0, 24.0, 0.0], 0.5)
    decay = (K * N) ** 2 / R / 15.0
    assert motion.signal("motor_v")[:, LIFT] == pytest.approx(
        24.0 / (K * N) * (1.0 - np.exp(-decay * motion.t)), abs=1e-6
    )


@EACH_FORM
def test_winding_warms_up_with_its_time_constant(form):
    resistance, capacity, current = 2.5, 40.0, 6.0
    heavy = cylindrical(A=0.0, m_2=1e15)
    effects = [WindingHeat(resistance, capacity, 400.0), MotorDrive((None, K, None), R, 0.0, N)]
    system, x = lift(form, effects, heavy)
    motion = simulate(system, x, [0.0, R * current, 0.0], 3.0 * resistance * capacity)
    rise = resistance * R * current**2 * (1.0 - np.exp(-motion.t / (resistance * capacity)))
    assert motion.ok
    assert np.max(np.abs(motion.signal("winding_xi")[:, 0] - 293.15 - rise)) < 1e-6
    assert np.max(np.abs(motion.signal("winding_phi") - 293.15)) < 1e-9
    assert system.initial == {"winding_phi": 293.15, "winding_xi": 293.15, "winding_r": 293.15}


def test_order_of_the_list_does_not_matter_and_what_is_missing_is_said():
    arm = spherical()
    heat, motor = WindingHeat(1.0, 100.0, 400.0), MotorDrive(0.1, 1.0, 1e-3)
    elastic = ElasticDrive(1e4, 0.5)
    lists = ([heat, motor, elastic, Gravity()], [Gravity(), elastic, motor, heat], [motor, heat, Gravity(), elastic])
    rates = []
    for effects in lists:
        system = canonical(arm, effects)
        values = {
            str(s): 0.1 + 0.01 * i for i, s in enumerate(sorted(map(str, ca.vertsplit(ca.vertcat(system.x, system.u)))))
        }
        point = [[values[str(s)] for s in ca.vertsplit(part)] for part in (system.x, system.u)]
        rate = np.array(ca.Function("f", [system.x, system.u], [system.rate])(*point)).ravel()
        rates.append(dict(zip((str(label) for label in system.labels["x"]), rate, strict=True)))
    for other in rates[1:]:
        assert other == pytest.approx(rates[0], rel=1e-12)
    with pytest.raises(ValueError, match=r"^winding_heat \(heated by the current of a motor\) reads the signal "
                       r"'copper_loss', which no effect of the list defines; add MotorDrive\(\.\.\.\)"):  # fmt: skip
        canonical(arm, [heat, Gravity()])


@pytest.mark.parametrize(
    ("pair", "thing"),
    [
        ((LaggedDrive(0.1), MotorDrive(0.1, 1.0)), "drives: lagged_drive and motor_drive"),
        ((ElasticDrive(1e4, 1.0), RotorInertia(1e-4)), "rotors: elastic_drive and rotor_inertia"),
        ((Coulomb(1.0), Coulomb(2.0)), "dry friction: coulomb, twice"),
        ((Viscous(1.0), Viscous(2.0)), "viscous friction: viscous, twice"),
        ((TorqueSpeed(1.0, 1.0), TorqueSpeed(2.0, 1.0)), "torque-speed limit: torque_speed, twice"),
    ],
)
def test_effects_that_define_the_same_thing_are_refused(pair, thing):
    for effects in (pair, pair[::-1]):
        words = thing.split(": ")[0]
        with pytest.raises(ValueError, match=f"^two effects define the {words}: .*; keep one of them"):
            lagrange(cylindrical(), effects)
    with pytest.raises(ValueError, match=thing):
        lagrange(cylindrical(), pair)


@EACH_FORM
def test_rest_means_that_nothing_moves_on(form):
    arm = spherical()
    lists = ([LaggedDrive(0.03)], [ElasticDrive(1e4, 0.5)], [MotorDrive(0.1, 1.0, 1e-3)],
             [LaggedDrive((0.1, None, 0.1, 0.1)), ElasticDrive(1e4, 0.5)],
             [MotorDrive(0.1, 1.0, 1e-3), ElasticDrive(1e4, 0.5)])  # fmt: skip
    q0 = [1.1, 0.2, 0.3, 0.8]
    for drives in lists:
        system = form(arm, [Gravity(), *drives])
        # The state at rest by Newton on "rest", then nothing but controls may move it.
        extra = system.x[8:]
        third = system["rest"][4:]
        keep = ca.substitute(third, system.x[:8], ca.vertcat(*q0, 0, 0, 0, 0))
        solve = ca.Function("z", [extra], [keep, ca.jacobian(keep, extra)])
        value, slope = (np.array(part) for part in solve(np.zeros(extra.numel())))
        z = np.linalg.lstsq(slope, -value.ravel(), rcond=None)[0]
        assert np.linalg.matrix_rank(slope) == len(z)
        rate = np.array(ca.Function("f", [system.x, system.u], [system.rate])([*q0, 0, 0, 0, 0, *z], np.zeros(4)))
        free = np.array(ca.DM(ca.jacobian_sparsity(system.rate, system.u)).full()).any(axis=1)
        assert np.max(np.abs(rate[~free])) < 1e-9
    assert "rest" not in form(arm, [Gravity(), MotorDrive(0.1, 1.0), WindingHeat(1.0, 10.0)]).signals


def test_ends_of_a_task_are_at_rest_and_start_warm():
    system = canonical(spherical(), [Gravity(), MotorDrive(0.1, 1.0, 1e-3), WindingHeat(1.0, 10.0, 400.0)])
    task = point_to_point(system, [0.9, 0, 0, 0.85], [1.6, 2, 0.5, 0.9], voltage=48.0)
    sizes = [(c.where.value, c.expression.numel()) for c in task.subject_to]
    assert sizes == [
        ("start", 4),
        ("start", 8),
        ("end", 4),
        ("end", 8),
        *[("start", 1)] * 4,
        ("along", 4),
        ("along", 4),
    ]
    assert [c.name for c in task.subject_to][-1] == "winding"
    assert list(task.subject_to[-1].upper) == [400.0] * 4
    assert [label.name for label in task.labels(task.subject_to[-1])] == [
        "winding_theta", "winding_psi", "winding_phi", "winding_r",
    ]  # fmt: skip


def test_limits_of_a_system_go_with_it():
    system = canonical(cylindrical(), [TorqueSpeed(100.0, 3.0, (80.0, None, 60.0)), Gravity()])
    assert set(system.limits) == {"torque_speed", "peak_torque"}
    for carried in (system, extend(system)):
        problem = Problem(carried, Fixed(1.0), subject_to=(start(carried["v"], 0),))
        assert [c.name for c in problem.subject_to[1:]] == ["torque_speed", "peak_torque"]
        again = Problem(carried, Fixed(1.0), subject_to=problem.subject_to)
        assert len(again.subject_to) == 3
    own = Problem(system, Fixed(1.0), subject_to=(along(system["torque_speed"], -0.5, 0.5, name="torque_speed"),))
    assert [c.name for c in own.subject_to] == ["torque_speed", "peak_torque"]
    assert list(own.subject_to[0].upper) == [0.5] * 3
    # A peak that stays a symbol limits the share.
    symbol = canonical(cylindrical(), [TorqueSpeed(100.0, 3.0, (Parameter(80.0), None, 60.0))])
    assert set(symbol.limits) == {"torque_speed", "peak_torque_share"}
    assert symbol["peak_torque_share"].numel() == 2
