"""Stiff and long simulations: nothing is torn, exhausted without a word, or stored step by step."""

import casadi as ca
import numpy as np
import pytest

from models import Motion, cylindrical, spherical
from models.effects import Coulomb, ElasticDrive, Gravity, LaggedDrive
from models.forms import lagrange
from ocp import Control, System, integrators, radau, simulate
from ocp.integrators.control_segments import Polynomial, Segment
from ocp.integrators.fixed_step import _Schedule
from ocp.integrators.gragg_bulirsch_stoer import integrate
from ocp.integrators.stiffness import Linearisation, decays, describe

none = ca.SX(0, 1)


def test_the_chains_of_the_midpoint_rule_do_not_part_at_a_thin_layer():
    # Even and odd steps on their own sides of v = 0 make an extrapolation that agrees with itself and is wrong.
    system = lagrange(cylindrical(), [Gravity(), Coulomb((5.0, 10.0, 10.0), 1e-6)])
    x0 = [0.0, 0.0, 0.5, 1.0, 0.3, -0.2]
    found, other = (
        simulate(system, x0, np.zeros(3), [0.5], method=m) for m in (None, integrators.radau_5(1e-11, 1e-12))
    )
    np.testing.assert_allclose(found.x, other.x, rtol=0, atol=1e-9)


def test_the_default_goes_on_implicitly_where_a_mode_dies_out():
    x = ca.SX.sym("x")
    found = simulate(System(x, none, none, -1e7 * (x - 0.5)), [1.0], [], [1.0])
    assert found.ok
    assert found.x[0, 0] == pytest.approx(0.5, abs=1e-11)
    assert found.evaluations < 20_000


def test_the_default_follows_a_fast_swing_past_the_rounding_of_f():
    k, rotor, force, t = 1e9, 1.0, 400.0, 0.01
    system = lagrange(cylindrical(), [ElasticDrive((None, k, None), (None, rotor, None))])
    n = cylindrical().nominal
    mass = n["m_2"] + n["m_3"]
    start = [
        0.1 if name in ("xi", "motor_q_xi") else 0.5 if name == "r" else 0.0 for name in map(str, system.x.elements())
    ]
    found = simulate(system, start, [0.0, force, 0.0], [t])
    omega = np.sqrt(k * (1 / mass + 1 / rotor))
    twist = force / rotor / omega**2 * (1 - np.cos(omega * t))  # of motor against load
    centre = 0.1 + force / (mass + rotor) * t**2 / 2
    assert found.ok
    assert found.signal("q")[0, 1] == pytest.approx(centre - rotor / (mass + rotor) * twist, abs=1e-13)
    assert found.evaluations < 100_000


def test_integrators_that_run_out_name_the_mode(monkeypatch):
    monkeypatch.setattr("ocp.integrators.adaptive_step.MOST_STEPS", 100)
    monkeypatch.setattr("ocp.integrators.cvodes.MOST_STEPS", 100)
    monkeypatch.setattr("ocp.integrators.gragg_bulirsch_stoer.MOST_STEPS", 100)
    x = ca.SX.sym("x", 2)
    swing = System(x, none, none, ca.vertcat(x[1], -1e10 * x[0]))
    for method in (None, integrators.dormand_prince_8(), integrators.bdf()):
        found = simulate(swing, [1.0, 0.0], [], [1.0], method=method)
        assert "100 steps were not enough" in found.message
        assert "oscillates at 1e+05 rad/s" in found.message
    lag = lagrange(cylindrical(), [LaggedDrive(1e-7)])
    found = simulate(lag, np.full(9, 0.5), np.zeros(3), [1.0], method=integrators.dormand_prince_5())
    assert "decays in 1e-07 s, so it is stiff there: use an implicit method" in found.message
    found = simulate(lag, np.full(9, 0.5), np.zeros(3), [1.0], method=integrators.runge_kutta_4(1e-3))
    assert "f is not finite; the fastest mode of the system decays in 1e-07 s" in found.message


def test_the_fastest_mode():
    x = ca.SX.sym("x", 3)
    rate = ca.vertcat(x[1], -100.0 * x[0], -3.0 * x[2])
    mode = Linearisation(System(x, none, none, rate), []).fastest(np.ones(3), np.zeros(0))
    assert abs(mode) == pytest.approx(10.0)
    assert not decays(mode)
    assert decays(-3.0 + 0.1j)
    assert describe(complex(np.nan, 0.0)) == ""


def test_overflow_in_a_step_is_no_warning():
    # Warnings are errors here.
    done = integrate(lambda t, x: x**40, 0.0, 10.0, np.full(2, 2.0), 1e-12, 1e-12, steps=50)
    assert done.reached < 10.0


def test_a_schedule_takes_no_memory_for_its_steps():
    segment = Segment(np.array([0.0, 1e6, 3e6]), Polynomial(0.0, 3e6, np.zeros(1), np.ones((1, 2)), np.ones_like))
    schedule = _Schedule.of([segment], 1e-3)
    assert schedule.total == 3_000_000_000
    widths, u = schedule.steps(999_999_998, 4, np.array([0.5]), 2)
    np.testing.assert_allclose(widths, 1e-3)
    assert u.shape == (8,)
    assert schedule.start(1_000_000_000) == 1e6


@pytest.mark.parametrize("scheme", [radau(5, Control.COLLOCATED), radau(3, Control.LINEAR)])
def test_a_control_at_one_time_is_that_at_many(scheme):
    values = np.random.default_rng(1).normal(size=(len(scheme.control_nodes), 3))
    shape = Polynomial(0.3, 0.1, scheme.control_nodes, values, scheme.control_at)
    t = np.linspace(0.3, 0.4, 11)
    np.testing.assert_allclose([shape(s) for s in t.tolist()], shape.sample(t), rtol=0, atol=1e-13)


@pytest.mark.parametrize("duration", [1e-80, 1e-160])
def test_a_motion_beyond_double_precision_is_refused(duration):
    with pytest.raises(ValueError, match=r"duration: got 1e-\d+, expected one number > 0, from 1e-40"):
        Motion.quintic([0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], duration)


def test_a_table_names_the_number_that_overflows():
    motion = Motion.of_time(lambda t: ca.vertcat(1 / (t - 0.5), t, t, 0.8), 1.0)
    with pytest.raises(ValueError, match=r"q_theta is inf at 0\.5 s"):
        motion.torques(spherical(), [Gravity()], times=[0.0, 0.5, 1.0])
    motion = Motion.of_time(lambda t: ca.vertcat(1e200 * t**2, t, t, 0.8), 1.0)
    with pytest.raises(ValueError, match=r"tau_r is -inf at 0\.\d+ s: .* too large for double precision"):
        motion.torques(spherical(), [Gravity()])


@pytest.mark.parametrize(("stretch", "size"), [(1e-200, 1.0), (1.0, 1e200)])
def test_smoothing_beyond_double_precision_ends_with_a_sentence(stretch, size):
    t = np.linspace(0.0, 1.0, 50)
    with pytest.raises(ValueError, match="beyond double precision for a smoothing spline"):
        Motion.from_samples(stretch * t, size * np.stack([0.9 + 0.1 * t, t, t, 0.8 + 0.0 * t], axis=1))
