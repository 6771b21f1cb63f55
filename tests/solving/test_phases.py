"""Sequences, obstacles, rate and jerk limits, design parameters, periodic motions: each solved and verified."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from models import Parameter, cylindrical, spherical, torus
from models.effects import Gravity, Payload
from models.forms import canonical, hamel
from ocp import (
    Ball,
    Bolza,
    Box,
    Cylinder,
    Fixed,
    Free,
    HalfSpace,
    Problem,
    Sequence,
    System,
    along,
    end,
    extend,
    inside,
    outside,
    periodic,
    point_to_point,
    prepare,
    solve,
    start,
    time_derivative,
    uniform,
    verify,
)

CARRIES = {
    "spherical": (
        spherical, [0.9, 0.0, 0.0, 0.85], [1.4, 1.0, 0.5, 0.8], [1.0, 2.0, 0.0, 0.8],
        ([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]), [300.0, 160.0, 3.0, 400.0],
    ),
    "cylindrical": (
        cylindrical, [0.0, 0.2, 0.6], [1.0, 0.3, 0.8], [2.0, 0.9, 0.6],
        ([-3.0, 0.0, 0.3], [3.0, 1.2, 1.0]), [150.0, 1000.0, 300.0],
    ),
    "torus": (
        torus, [0.0, 0.4, -0.9], [1.0, 0.2, -0.8], [2.0, 0.8, -1.3],
        ([-3.0, -0.3, -2.6], [3.0, 2.0, 2.6]), [250.0, 600.0, 220.0],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CARRIES)
def test_pick_up_and_carry(name: str) -> None:
    make, q0, pick, q1, within, drives = CARRIES[name]
    empty, loaded = canonical(make(), [Gravity()]), canonical(make(), [Gravity(), Payload(4.0)])
    grid = uniform(25)
    fetch = Problem(
        empty,
        subject_to=(
            start(empty["q"], q0), start(empty["v"], 0.0), end(empty["q"], pick), end(empty["v"], 0.0),
            along(empty["q"], *within), along(empty["tau"], -np.array(drives), drives),
        ),
    )  # fmt: skip
    carry = Problem(
        loaded,
        subject_to=(
            end(loaded["q"], q1), end(loaded["v"], 0.0),
            along(loaded["q"], *within), along(loaded["tau"], -np.array(drives), drives),
        ),
    )  # fmt: skip
    both = solve(Sequence((fetch, carry)), grid=grid)
    assert both.ok, both.message
    assert both.duration == pytest.approx(both.cost, rel=1e-12)
    before, after = both.phases
    np.testing.assert_allclose(before.signal("q", before.duration), after.signal("q", 0.0), atol=1e-9)
    np.testing.assert_allclose(before.signal("v", before.duration), after.signal("v", 0.0), atol=1e-9)
    for phase in both.phases:
        assert not verify(phase).failures
    whole = verify(both)
    assert whole.ok
    assert whole.drift == max(verify(phase).drift for phase in both.phases)
    torn = replace(both, phases=(before, replace(after, states=after.states + 0.01)))
    assert verify(torn).violation > 1e-3
    # Rest at the junction decouples the phases: each alone takes as long.
    alone = solve(fetch, grid=grid)
    rest = (start(loaded["q"], pick), start(loaded["v"], 0.0))
    then = solve(replace(carry, subject_to=(*carry.subject_to, *rest)), grid=grid)
    assert before.duration == pytest.approx(alone.duration, rel=1e-6)
    assert after.duration == pytest.approx(then.duration, rel=1e-6)


def test_momentum_is_not_what_is_continuous_at_a_pick_up() -> None:
    """Without rest at the junction v is continuous, so p jumps by the load; the motion gets faster than with rest."""
    make, q0, pick, q1, within, drives = CARRIES["cylindrical"]
    empty, loaded = hamel(make(), [Gravity()]), canonical(make(), [Gravity(), Payload(4.0)])
    limits = [(along(s["q"], *within), along(s["tau"], -np.array(drives), drives)) for s in (empty, loaded)]
    fetch = Problem(
        empty, subject_to=(start(empty["q"], q0), start(empty["v"], 0.0), end(empty["q"], pick), *limits[0])
    )
    carry = Problem(loaded, subject_to=(end(loaded["q"], q1), end(loaded["v"], 0.0), *limits[1]))
    flying = solve(Sequence((fetch, carry)), grid=uniform(25))
    resting = solve(
        Sequence((replace(fetch, subject_to=(*fetch.subject_to, end(empty["v"], 0.0))), carry)), grid=uniform(25)
    )
    assert flying.ok
    assert resting.ok
    assert flying.duration < 0.95 * resting.duration
    speed = flying.phases[0].signal("v", flying.phases[0].duration)
    assert np.max(np.abs(speed)) > 0.1
    np.testing.assert_allclose(flying.phases[1].signal("v", 0.0), speed, atol=1e-8)
    assert all(not verify(phase).failures for phase in flying.phases)


def test_fixed_durations_in_a_sequence_have_the_exact_cost() -> None:
    """x'' = u, rest to rest over 1 in two halves of fixed duration: min of the integral of u^2 is 12 / T^3."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    system = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u), {"q": x[0], "v": x[1]}, {})
    cost = Bolza(running=u**2)
    first = Problem(system, Fixed(0.75), cost, (start(system["q"], 0.0), start(system["v"], 0.0)))
    second = Problem(system, Fixed(1.25), cost, (end(system["q"], 1.0), end(system["v"], 0.0)))
    whole = solve(Sequence((first, second)), grid=uniform(40))
    assert whole.ok
    # One control value for each element: the cost is above the optimum by the square of the width.
    assert 12.0 / 8.0 <= whole.cost <= 12.0 / 8.0 * (1.0 + 2e-3)


def cylinder_task() -> tuple[System, Problem]:
    arm = canonical(cylindrical(), [Gravity()])
    _, q0, _, _, within, drives = CARRIES["cylindrical"]
    return arm, point_to_point(arm, q0, [2.0, 0.8, 0.8], q=within, tau=drives)


@pytest.mark.parametrize("kind", ["ball", "cylinder", "capped", "box"])
def test_an_obstacle_changes_the_path(kind: str) -> None:
    arm, task = cylinder_task()
    free = solve(task)
    middle = free.signal("tool", free.duration / 2.0)
    region = {
        "ball": Ball(middle, 0.15),
        "cylinder": Cylinder(middle, (0.0, 0.0, 1.0), 0.15),
        "capped": Cylinder(middle, (0.0, 0.0, 1.0), 0.15, 0.6),
        "box": Box(middle - 0.12, middle + 0.12),
    }[kind]
    around = solve(replace(task, subject_to=(*task.subject_to, outside(region, arm["tool"]))), grid=uniform(100))
    assert around.ok
    assert around.duration > 1.005 * free.duration
    assert not verify(around).failures
    tool = around.signal("tool", np.linspace(0.0, around.duration, 2001))
    apart = tool - middle
    # Between two points that keep clear, a path bent the other way with the same radius cuts twice the sagitta.
    chord = np.linalg.norm(np.diff(around.signal("tool", around.t), axis=0), axis=1).max()
    sagitta = 2.0 * chord**2 / (8.0 * 0.12**2)
    # Written out again for each region: the distance of the true region, not of its rounded one.
    clear = {
        "ball": np.linalg.norm(apart, axis=1) / 0.15,
        "cylinder": np.hypot(apart[:, 0], apart[:, 1]) / 0.15,
        "capped": np.maximum(np.hypot(apart[:, 0], apart[:, 1]) / 0.15, np.abs(apart[:, 2]) / 0.3),
        "box": np.max(np.abs(apart), axis=1) / 0.12,
    }[kind]
    assert clear.min() > 1.0 - sagitta
    assert clear.min() < 1.2  # it passes close by


def test_a_wall_keeps_the_tool_on_its_side() -> None:
    arm = canonical(spherical(), [Gravity()])
    _, q0, _, _, within, drives = CARRIES["spherical"]
    task = point_to_point(arm, q0, [1.6, 2.0, 0.5, 0.9], q=within, tau=drives)
    free = solve(task)
    height = free.signal("tool", np.linspace(0.0, free.duration, 501))[:, 2]
    ceiling = (height[0] + height.max()) / 2.0
    wall = inside(HalfSpace((0.0, 0.0, ceiling), (0.0, 0.0, 2.0)), arm["tool"])
    kept = solve(replace(task, subject_to=(*task.subject_to, wall)))
    assert height.max() > ceiling + 0.01
    assert kept.ok
    assert kept.duration > free.duration
    assert kept.signal("tool", np.linspace(0.0, kept.duration, 501))[:, 2].max() < ceiling + 1e-3
    assert not verify(kept).failures


def test_rate_limits_of_the_drives() -> None:
    arm, task = cylinder_task()
    _, q0, _, _, within, drives = CARRIES["cylindrical"]
    fast = extend(arm)
    rates = np.array(drives) * 25.0
    limited = solve(point_to_point(fast, q0, [2.0, 0.8, 0.8], q=within, tau=drives, du=rates))
    assert limited.ok
    assert not verify(limited).failures
    assert limited.duration > solve(task).duration
    t = np.linspace(0.0, limited.duration, 4001)
    steps = np.abs(np.diff(limited.signal("tau", t), axis=0)) / np.diff(t)[:, None]
    assert np.all(steps <= rates * (1.0 + 1e-6))
    assert np.any(steps >= rates * (1.0 - 1e-6))


def test_jerk_limits_against_finite_differences() -> None:
    _, q0, _, _, within, drives = CARRIES["cylindrical"]
    arm = extend(canonical(cylindrical(), [Gravity()]))
    acceleration = time_derivative(arm, arm["v"])
    jerk = time_derivative(arm, acceleration)
    most = np.array([200.0, 60.0, 150.0])
    task = point_to_point(arm, q0, [2.0, 0.8, 0.8], q=within, tau=drives)
    smooth_ends = (start(acceleration, 0.0), end(acceleration, 0.0), along(jerk, -most, most, name="jerk"))
    solution = solve(replace(task, subject_to=(*task.subject_to, *smooth_ends)), grid=uniform(80))
    assert solution.ok
    assert verify(solution).violation < 1e-2
    t = np.linspace(0.0, solution.duration, 2001)
    v = solution.signal("v", t)
    measured = np.gradient(np.gradient(v, t, axis=0), t, axis=0)[5:-5]
    assert np.all(np.abs(measured) < most * 1.02)
    # The turn and the arm use their limits; the lift has time to spare.
    assert np.all(np.max(np.abs(measured), axis=0)[[0, 2]] > 0.9 * most[[0, 2]])
    np.testing.assert_allclose(np.gradient(v, t, axis=0)[[0, -1]], 0.0, atol=0.3)


def test_a_link_length_is_optimised() -> None:
    arm = canonical(torus(L_2=Parameter(0.7)), [Gravity()])
    _, q0, _, q1, within, drives = CARRIES["torus"]
    task = point_to_point(arm, q0, q1, q=within, tau=drives)
    # A longer link costs time, a short one reach: the tool must end at least 0.9 m from the axis.
    far = end(ca.sumsqr(arm["tool"][:2]), 0.9**2, np.inf)
    task = replace(task, subject_to=(*(c for c in task.subject_to if c.where.value != "end"), far, end(arm["v"], 0.0)))
    turned = end(arm["q"][0], 2.0)
    task = replace(task, subject_to=(*task.subject_to, turned))
    designed = solve(replace(task, subject_to=(*task.subject_to, along(arm.p, 0.4, 1.0, name="L_2"))), grid=uniform(30))
    assert designed.ok
    assert not verify(designed).failures
    best = designed.free["L_2"]
    prepared = prepare(task, grid=uniform(30))
    for length in (best - 0.03, best + 0.03):
        if 0.4 <= length <= 1.0:
            other = prepared(guess=designed, values={"L_2": length})
            assert other.ok
            assert other.duration > designed.duration


def test_a_periodic_motion_with_known_cost() -> None:
    """One turn in T at constant speed: the arm is held at its inner limit against the centrifugal force."""
    machine = cylindrical()
    arm = canonical(machine, [Gravity()])
    duration, inner = 2.0, 0.4
    mass, lifted = machine.nominal["m_3"], machine.nominal["m_2"] + machine.nominal["m_3"]
    task = Problem(
        arm,
        Fixed(duration),
        Bolza(running=ca.sumsqr(arm["tau"]) / 1e4),
        (
            start(arm["q"][0], 0.0), start(arm["q"][1], 0.5),
            periodic(arm["q"], [2.0 * np.pi, 0.0, 0.0]), periodic(arm["v"]), along(arm["q"][2], inner, 1.0),
        ),
    )  # fmt: skip
    solution = solve(task, grid=uniform(20))
    assert solution.ok, solution.message
    assert not verify(solution).failures
    speed = 2.0 * np.pi / duration
    forces = (0.0, lifted * 9.81, -mass * inner * speed**2)
    exact = duration * sum(force**2 for force in forces) / 1e4
    assert solution.cost <= exact * (1.0 + 1e-9)
    np.testing.assert_allclose(solution.signal("q", solution.duration)[1:], solution.signal("q", 0.0)[1:], atol=1e-9)
    np.testing.assert_allclose(solution.signal("v", solution.duration), solution.signal("v", 0.0), atol=1e-8)


def test_a_sequence_refuses_what_does_not_fit() -> None:
    arm, task = cylinder_task()
    with pytest.raises(ValueError, match="at least two"):
        Sequence((task,))
    with pytest.raises(TypeError, match="Problems"):
        Sequence((task, arm))  # type: ignore[arg-type]
    with pytest.raises(KeyError, match="no signal 'momentum'"):
        Sequence((task, task), links=("momentum",))
    with pytest.raises(ValueError, match="depends on the control"):
        Sequence((task, task), links=("tau",))
    with pytest.raises(ValueError, match="components before"):
        Sequence((task, task), links=((arm["q"], arm["q"][0]),))


def test_regions_refuse_what_is_none() -> None:
    arm, _ = cylinder_task()
    with pytest.raises(ValueError, match="Ball: radius"):
        Ball((0.0, 0.0, 0.0), -1.0)
    with pytest.raises(ValueError, match="Box: lower"):
        Box((0.0, 0.0, 1.0), (1.0, 1.0, 0.5))
    with pytest.raises(ValueError, match="Cylinder: axis"):
        Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="HalfSpace: normal"):
        HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="2 dimensions, the point has 3"):
        outside(Ball((0.0, 0.0), 1.0), arm["tool"])
    with pytest.raises(TypeError, match="expected an expression"):
        outside(Ball((0.0, 0.0), 1.0), [1.0, 2.0])  # type: ignore[arg-type]


def test_time_derivative_needs_states() -> None:
    arm, _ = cylinder_task()
    with pytest.raises(ValueError, match="use extend"):
        time_derivative(arm, arm["tau"])
    thrice = extend(extend(extend(arm)))
    assert thrice.x.numel() == arm.x.numel() + 9
    with pytest.raises(ValueError, match="three times"):
        extend(thrice)
    assert Free(1.0).lower == 0.0
