"""What effects mean for a solved motion, against motions solved with and without them."""

from functools import cache

import numpy as np
import pytest

import models.effects
from models import Estimate, cylindrical, estimate, inverse_dynamics, recover
from models.effects import (
    Coulomb,
    ElasticDrive,
    Gravity,
    LaggedDrive,
    MotorDrive,
    Payload,
    RotorInertia,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.forms import canonical
from models.mechanics.contributions import Contribution
from models.mechanics.linear_response import lag_error, oscillator_error
from models.mechanics.terms import Quantity, Terms, name_of
from models.torques.effect_estimates import typical
from ocp import point_to_point, solve, uniform

ON = (Gravity(), Viscous((5.0, 40.0, 30.0)))
LIMIT = np.array([150.0, 1000.0, 300.0])


@cache
def solved(effects=ON):
    arm = cylindrical()
    system = canonical(arm, effects)
    task = point_to_point(system, [0.0, 0.2, 0.6], [1.2, 0.6, 0.8], tau=LIMIT)
    return arm, system, solve(task, grid=uniform(25))


def rows_of(candidates=None, effects=ON):
    arm, system, solution = solved(effects)
    rows = estimate(system, arm, effects, solution, candidates)
    return {row.name: row for row in rows}


def test_every_known_effect_is_judged():
    rows = rows_of()
    names = set(rows)
    assert all(isinstance(row, Estimate) for row in rows.values())
    assert [rows[name].on for name in ("gravity", "viscous", "payload", "coulomb")] == [True, True, False, False]
    built = {"joint_stop", "counterbalance", "motion_limits"}  # no usual size
    assert names | built == {name_of(getattr(models.effects, name)) for name in models.effects.__all__}
    order = [row.on for row in rows.values()]
    assert order == sorted(order, reverse=True)
    text = str(rows["gravity"])
    assert text.startswith("gravity")
    assert "on" in text
    assert "% of peak torque" in text


def test_effects_on_joints_are_what_inverse_dynamics_says():
    arm, system, solution = solved()
    load = Payload(6.0, (0.0, 0.1, 0.0), (0.02, 0.02, 0.03))
    rows = rows_of((load, Coulomb(4.0, 0.05), RotorInertia(1e-4, (80.0, 200.0, 150.0))))
    t, x, rate, _ = solution.samples(np.linspace(0.0, 1.0, 9))
    none = np.zeros((0, len(t)))
    q, v, a, tau = (np.array(part) for part in recover(system, arm, ON).map(len(t))(x.T, rate.T, none))
    with_it = np.array(inverse_dynamics(arm, [*ON, load]).map(len(t))(q, v, a, none))
    assert rows["payload"].peak == pytest.approx(np.max(np.abs(with_it - tau), axis=1), rel=1e-9, abs=1e-9)
    assert rows["payload"].share == pytest.approx(rows["payload"].peak / np.max(np.abs(tau), axis=1))
    assert rows["viscous"].peak == pytest.approx([5.0, 40.0, 30.0] * np.max(np.abs(v), axis=1), rel=1e-9)
    weight = (arm.nominal["m_2"] + arm.nominal["m_3"]) * 9.81
    assert rows["gravity"].rms == pytest.approx([0.0, weight, 0.0], abs=1e-9)
    assert rows["coulomb"].peak == pytest.approx([4.0] * 3, rel=1e-2)
    reflected = 1e-4 * np.array([80.0, 200.0, 150.0]) ** 2
    assert rows["rotor_inertia"].peak == pytest.approx(reflected * np.max(np.abs(a), axis=1), rel=1e-9)


def test_limits_and_heat_are_shares():
    *_, solution = solved()
    tau = solution.signal("tau", solution.samples(np.linspace(0.0, 1.0, 9))[0])
    assert np.max(np.abs(tau[:, 0])) == pytest.approx(LIMIT[0], rel=1e-5)
    rows = rows_of(
        (
            TorqueSpeed((4.0 * LIMIT[0], 1e6, 1e6), 1e6),
            MotorDrive(0.1, 0.8, 1e-3, 100.0),
            WindingHeat(2.0, 100.0, 393.15),
        )
    )
    assert rows["torque_speed"].use == pytest.approx(0.25, rel=1e-3)
    assert np.all(rows["torque_speed"].peak == 0.0)
    mean_loss = 0.8 * np.max(rms(solution)) ** 2 / 10.0**2
    assert rows["winding_heat"].use == pytest.approx(2.0 * mean_loss / 100.0, rel=0.02)
    alone = rows_of((WindingHeat(2.0, 100.0),))["winding_heat"]
    assert np.isnan(alone.use)
    assert alone.note == "needs a MotorDrive"


def rms(solution):
    t, _, _, _ = solution.samples(np.linspace(0.0, 1.0, 9))
    return np.sqrt(np.trapezoid(solution.signal("tau", t).T ** 2, t) / solution.duration)


def test_drives_that_are_on_are_judged_by_their_own_parameters():
    effects = (Gravity(), LaggedDrive(0.02))
    arm = cylindrical()
    system = canonical(arm, effects)
    task = point_to_point(system, [0.0, 0.2, 0.6], [0.8, 0.4, 0.7], command=2.0 * LIMIT)
    solution = solve(task, grid=uniform(25))
    assert solution.ok
    rows = {row.name: row for row in estimate(system, arm, effects, solution, ())}
    t, _, _, _ = solution.samples(np.linspace(0.0, 1.0, 9))
    behind = solution.signal("command", t) - solution.signal("tau", t)
    # What is behind the motion's own torque is what lies behind the command, one lag later.
    assert np.all(rows["lagged_drive"].peak > 0.1 * np.max(np.abs(behind), axis=0))
    assert np.all(rows["lagged_drive"].peak < 2.0 * np.max(np.abs(behind), axis=0))


class Belt:
    """A drive of a user: its contribution is a method of its own."""

    def __call__(self, machine, so_far):
        return Terms()

    def contribution(self, sizes, motion, effects):
        return Contribution(0.1 * motion.tau, 0.7, f"{sizes.machine.name}, {len(effects)} effects")


class SpeedLimit:
    """A limit of a user: the terms describe it completely."""

    def __call__(self, machine, so_far):
        return Terms(signals={"fast": Quantity(machine.v[0], "rad/s")}, limits={"fast": (-4.0, 8.0)})


def test_effects_of_users_are_judged_by_what_they_bring():
    _, _, solution = solved()
    rows = rows_of((Belt(), SpeedLimit()))
    assert rows["belt"].share == pytest.approx([0.1] * 3)
    assert (rows["belt"].use, rows["belt"].note) == (0.7, "cylindrical, 4 effects")
    v = solution.signal("v", solution.samples(np.linspace(0.0, 1.0, 9))[0])[:, 0]
    assert rows["speed_limit"].use == pytest.approx(max(np.max(v) / 8.0, np.max(-v) / 4.0))


def test_effects_that_cannot_be_added_are_not_proposed():
    arm, system, solution = solved()
    names = {row.name for row in estimate(system, arm, (*ON, Coulomb(1.0)), solution)}
    assert "coulomb" in names
    assert "stribeck" not in names


def test_lag_and_oscillator_are_integrated_exactly():
    t = np.linspace(0.0, 1.0, 41)
    step = np.ones((1, 42))
    jump = np.append(0.0, t)
    step[0, 0] = 0.0
    assert lag_error(jump, step, np.array([0.3]))[0, 1:] == pytest.approx(np.exp(-t / 0.3))
    assert oscillator_error(jump, step, np.array([7.0]))[0, 1:] == pytest.approx(np.cos(7.0 * t))
    ramp = 2.0 * t[None, :]
    assert lag_error(t, ramp, np.array([0.3]))[0] == pytest.approx(0.6 * (1.0 - np.exp(-t / 0.3)))
    assert oscillator_error(t, ramp, np.array([7.0]))[0] == pytest.approx(2.0 * np.sin(7.0 * t) / 7.0)
    for rigid in (np.array([np.nan]), np.array([0.0])):
        assert np.all(lag_error(jump, step, rigid) == 0.0)
        assert np.all(oscillator_error(jump, step, rigid) == 0.0)


def test_typical_effects_have_the_documented_sizes():
    arm = cylindrical()
    effects = {type(e): e for e in typical(arm, np.array([[10.0], [-20.0], [30.0]]), np.array([[2.0], [1.0], [0.5]]))}
    assert effects[Payload].mass == pytest.approx(0.1 * (arm.nominal["m_2"] + arm.nominal["m_3"]))
    assert effects[Viscous].c == pytest.approx((0.25, 1.0, 3.0))
    assert effects[Coulomb].f == pytest.approx((0.5, 1.0, 1.5))
    assert effects[TorqueSpeed].stall == pytest.approx((20.0, 40.0, 60.0))
    assert effects[RotorInertia].ratio == (100.0, 300.0, 300.0)
    assert effects[ElasticDrive].inertia == pytest.approx((1.0, 9.0, 9.0))
    motor = effects[MotorDrive]
    assert motor.inductance / motor.resistance == pytest.approx(2e-3)
