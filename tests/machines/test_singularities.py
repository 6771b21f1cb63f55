"""Singularities of frames and metrics: refused when built, or named where a motion meets them; never a silent NaN."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from catalogue.machines import NAMES, machine
from hard_cases.pole import METHODS, moved, system_of

from models import Parameter, cylindrical, spherical, torus
from models.effects import Gravity, RotorInertia
from models.forms import canonical, hamel, lagrange
from ocp import (
    Free,
    Problem,
    Status,
    System,
    along,
    end,
    extend,
    integrators,
    point_to_point,
    simulate,
    solve,
    start,
    uniform,
    verify,
)
from ocp.system import Singularity

FORMS = (lagrange, hamel, canonical)
EACH_FORM = pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
POLE = r"the frame 'paper' of the spherical manipulator is singular where sin\(theta\) is 0; use frame='regular'"


@pytest.mark.parametrize(
    "form", [lagrange, *(pytest.param(form, marks=pytest.mark.slow) for form in (hamel, canonical))],
    ids=lambda form: form.__name__,
)  # fmt: skip
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_motion_through_the_pole_is_refused_in_the_frame_of_the_source(form, method):
    got = moved(form, "paper", method)
    assert not got.ok
    assert POLE.replace("\\", "") in got.message
    assert np.all(np.isnan(got.x))
    assert moved(form, "regular", method).ok


def test_a_motion_through_the_pole_keeps_what_lies_before_it():
    system, x0 = system_of(canonical, "paper")
    got = simulate(system, x0, np.zeros(4), 0.3)
    reached = np.all(np.isfinite(got.x), axis=1)
    before = got.t < 0.163
    assert np.array_equal(reached, before | (got.t < float(got.message.split("t = ")[1].split(" s")[0])))
    regular, y0 = system_of(lagrange, "regular")
    exact = simulate(regular, y0, np.zeros(4), 0.3).signal("q")
    assert np.max(np.abs(got.signal("q")[got.t < 0.15] - exact[got.t < 0.15])) < 1e-9


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_there_and_back_between_two_reported_times_is_noticed(method):
    push, last = [60.0, 0.0, 0.0, 0.0], 0.6
    regular, y0 = system_of(lagrange, "regular")
    theta = simulate(regular, y0, push, last).signal("q")[:, 0]
    assert theta.min() < -0.01
    assert theta[-1] > 0.0
    system, x0 = system_of(hamel, "paper")
    assert "sin(theta) is 0" in simulate(system, x0, push, [last], method=method).message


def test_regular_machines_have_no_singularities_to_watch():
    for name in NAMES:
        for form in FORMS:
            assert form(machine(name), [Gravity()]).singular == ()


@EACH_FORM
def test_a_machine_without_inertia_about_a_coordinate_is_refused(form):
    for arm, words in (
        (spherical(Theta_3_33=0.0, physical=False), "spherical .* no inertia about phi at any .* give Theta_3_33"),
        (cylindrical(m_3=0.0, physical=False), "cylindrical .* no inertia about r at any .* give m_3"),
    ):
        with pytest.raises(ValueError, match=words):
            form(arm)
    assert form(spherical(Theta_3_33=0.0, physical=False), [RotorInertia(1e-4, (70.0,) * 4)]).singular == ()


@EACH_FORM
def test_a_frame_that_loses_half_its_digits_is_refused(form):
    heavy = cylindrical(A=1.0, m_2=1e-11, Theta_1_33=1e-11, Theta_2_33=1e-11, Theta_3_33=1e-11)
    with pytest.raises(ValueError, match=r"frame 'ldl' keeps \d of sixteen digits .* use frame='regular'"):
        form(heavy, frame="ldl")
    with pytest.raises(ValueError, match=r"frame 'paper' keeps no of sixteen digits"):
        form(cylindrical(A=1e-200), frame="paper")
    assert form(heavy).singular == ()


def test_a_parameter_that_makes_the_frame_singular_is_named():
    thick = {"L_2": 0.83, "L_3": 0.67, "m_2": 29.9, "m_3": 29.5, "Theta_2_22": 1.0}  # I_2 = I_3 for 23.16144
    for arm, values, words in (
        (cylindrical(A=Parameter(0.1)), {"A": 0.0}, "'paper' of the cylindrical manipulator is singular where A is 0"),
        (spherical(Theta_3_33=Parameter(0.05)), {"Theta_3_33": 0.0}, "no inertia about phi"),
        (torus(**thick, Theta_3_22=Parameter(1.0)), {"Theta_3_22": 23.16144}, "is singular where B_c is 0"),
    ):
        system = hamel(arm, frame="paper")
        x0 = np.full(system.x.numel(), 0.5)
        assert simulate(system, x0, np.zeros(system.u.numel()), 0.01).ok
        got = simulate(system, x0, np.zeros(system.u.numel()), 0.01, values=values)
        assert words in got.message


@EACH_FORM
def test_solves_say_which_singularity_is_in_the_way(form):
    arm = form(spherical(), [Gravity()], "paper")
    ends = [0.9, 0.0, 0.0, 0.85], [-0.7, 1.0, 0.5, 0.9]
    for q0, q1, words in ((*ends, "on two sides of"), ([0.0, *ends[0][1:]], ends[0], "the start is singular")):
        results = solve(point_to_point(arm, q0, q1, tau=400.0), grid=uniform(10))
        assert results.status is Status.FAILED
        assert results.solver_status == "not started"
        assert words in results.message
        assert POLE.replace("\\", "") in results.message
        assert np.all(np.isfinite(results.states))


def stepping_over():
    """Return the way from -1 to 1 in a system that is singular at 0.05, its end hidden in an expression."""
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    hole = Singularity(x - 0.05, 1e-6, "there is a hole at x = 0.05; walk round it", crossed=True)
    system = System(x, u, ca.SX(0, 1), u, {"x": x, "u": u}, singular=(hole,))
    limits = start(x, -1.0), end(x + 0.1 * ca.sin(x), 1.0), along(u, -1.0, 1.0)
    return Problem(system, horizon=Free(guess=2.0), subject_to=limits)


def test_a_solution_that_steps_over_a_singularity_is_no_solution():
    task = stepping_over()
    results = solve(task, grid=uniform(10))
    assert results.status is Status.FAILED
    assert results.solver_status == "Solve_Succeeded"
    assert "there is a hole at x = 0.05; walk round it" in results.message
    assert not verify(results).ok
    free = replace(task, system=replace(task.system, singular=()))
    assert solve(free, grid=uniform(10)).ok
    assert verify(results).drift > 1.0  # the integration ends there


def test_singularities_travel_with_the_system():
    system = stepping_over().system
    for other in (pickle.loads(pickle.dumps(system)), extend(system)):
        (place,) = other.singular
        assert (place.least, place.crossed) == (1e-6, True)
        control = np.ones(1) if other.x.numel() == 1 else np.zeros(1)
        got = simulate(other, [-1.0, 1.0][: other.x.numel()], control, 2.0)
        assert "walk round it" in got.message


def test_a_singularity_may_not_depend_on_the_control():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    with pytest.raises(ValueError, match="depends on the control; expected x and p"):
        System(x, u, ca.SX(0, 1), u, singular=(Singularity(x - u, 0.0, "here"),))


def test_integrators_stop_at_infinity_without_a_warning():
    x = ca.SX.sym("x")
    system = System(x, ca.SX(0, 1), ca.SX(0, 1), 1e300 * x**3)
    for method in (integrators.extrapolation(), integrators.dormand_prince_8(), integrators.radau_5()):
        assert not simulate(system, [1e39], [], 1.0, method=method).ok
