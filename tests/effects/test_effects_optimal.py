"""Time-optimal motions with effects: limits of drives against closed solutions, and scenes with everything on."""

from functools import cache

import numpy as np
import pytest
from time_optimal import TASKS

from models import Parameter, cylindrical
from models.effects import (
    Coulomb,
    Gravity,
    MotorDrive,
    Payload,
    PowerLimit,
    RotorInertia,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)
from models.forms import canonical, hamel, lagrange
from ocp import Control, given, point_to_point, radau, solve, uniform, verify

FORMS = (canonical, hamel, lagrange)
MASS, WAY = 65.0, 0.9  # of the lift, m_2 + m_3, and how far it goes
LINEAR = radau(3, control=Control.LINEAR)  # torque-speed arcs slope: constant controls lose first order in the width
# Of the machines in the order of their drives: viscous, Coulomb with width, rotor and ratio, no-load speed.
FRICTION = {
    "spherical": ((8.0, 6.0, 0.05, 60.0), (6.0, 4.0, 0.1, 15.0), (0.1, 0.1, 0.2, 0.04)),
    "cylindrical": ((6.0, 60.0, 40.0), (4.0, 20.0, 8.0), (0.1, 0.04, 0.04)),
    "torus": ((8.0, 12.0, 5.0), (6.0, 10.0, 4.0), (0.1, 0.1, 0.1)),
}
RATIO = {"spherical": (70.0, 60.0, 10.0, 150.0), "cylindrical": (70.0, 250.0, 150.0), "torus": (100.0, 120.0, 80.0)}
NO_LOAD = {"spherical": (4.0, 4.0, 8.0, 1.5), "cylindrical": (4.0, 2.0, 2.0), "torus": (4.0, 4.0, 4.0)}


def scene(name):
    """Return the task of a machine, the machine and all effects that a real one would have."""
    task = TASKS[name]
    viscous, coulomb, width = FRICTION[name]
    stall = tuple(1.6 * limit for limit in task.limit)
    limit = TorqueSpeed(stall, NO_LOAD[name], task.limit)
    effects = [
        Gravity(),
        Payload(4.0),
        Viscous(viscous),
        Coulomb(coulomb, width),
        RotorInertia(1e-4, RATIO[name]),
        limit,
    ]
    return task, task.machine(), effects


@cache
def solved(name, form, elements=40):
    task, machine, effects = scene(name)
    arm = form(machine, effects)
    return solve(point_to_point(arm, task.q0, task.q1, q=(task.q_min, task.q_max)), LINEAR, uniform(elements))


def finer(solution, tolerance=1e-8):
    """Return the grid of a solution with elements cut by their local error."""
    parts = np.clip(np.ceil((solution.error / tolerance) ** 0.25), 1, 4).astype(int)
    pieces = zip(solution.grid.ends[:-1], solution.grid.widths, parts, strict=True)
    return given([0.0, *np.concatenate([a + w * np.arange(1, k + 1) / k for a, w, k in pieces])[:-1], 1.0])


@pytest.mark.parametrize("name", TASKS)
def test_forms_agree_on_scenes_with_everything(name):
    results = [solved(name, form) for form in FORMS]
    assert all(solution.ok for solution in results)
    durations = np.array([solution.duration for solution in results])
    assert np.ptp(durations) < 1e-6 * durations[0]
    use = np.abs(results[0].signal("torque_speed", results[0].samples(LINEAR.points)[0]))
    assert 0.999 < np.max(use) < 1.0 + 1e-6  # at the points that the limit is held at
    assert verify(results[0]).energy < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_scenes_with_everything_are_verified(name):
    # Friction turns its sign within milliseconds at both ends: the grid must be fine there, and only there.
    solution = solved(name, canonical)
    before = solution.duration
    for _ in range(2):
        before = solution.duration
        solution = solve(solution.problem, LINEAR, finer(solution), guess=solution)
    report = verify(solution)
    assert report.ok, str(report)
    assert report.drift < 1e-6
    assert solution.duration == pytest.approx(before, rel=1e-4)


def lift(effects):
    """Return the fastest motion of the lift alone, from rest to rest, on grids of 20 and 40 elements."""
    arm = canonical(cylindrical(A=0.0), effects)
    task = point_to_point(arm, [0.0, 0.1, 0.6], [0.0, 0.1 + WAY, 0.6])
    return [solve(task, LINEAR, uniform(elements)) for elements in (20, 40)]


def root(function, low, high):
    """Return the zero of an increasing function by bisection."""
    for _ in range(200):
        middle = (low + high) / 2.0
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return low


def test_torque_speed_limit_gives_the_time_of_theory():
    stall, no_load, peak = 500.0, 1.6, 300.0
    coarse, fine = lift([TorqueSpeed((50.0, stall, 50.0), no_load, (40.0, peak, 40.0))])
    # Peak force up to its corner, then v = no_load (1 - exp) towards no_load, then the peak force backwards.
    corner = no_load * (1.0 - peak / stall)
    first = corner * MASS / peak

    def course(t):
        decay = (no_load - corner) * np.exp(-stall * t / (MASS * no_load))
        speed = no_load - decay
        way = corner**2 * MASS / (2.0 * peak) + no_load * t - (no_load - corner - decay) * MASS * no_load / stall
        return way + MASS * speed**2 / (2.0 * peak) - WAY, first + t + MASS * speed / peak

    exact = course(root(lambda t: course(t)[0], 0.0, 5.0))[1]
    assert fine.ok
    assert abs(fine.duration - exact) < 1e-3 * exact
    assert abs(fine.duration - exact) < 0.6 * abs(coarse.duration - exact) + 1e-6
    assert verify(fine).violation < 2e-3


@pytest.mark.parametrize("symbol", [False, True])
def test_power_limit_gives_the_time_of_theory(symbol):
    power, peak = 220.0, 300.0
    limit = PowerLimit(Parameter(power) if symbol else power)
    coarse, fine = lift([limit, TorqueSpeed((1e6, 1e6, 1e6), 1e6, (40.0, peak, 40.0))])
    # Peak force up to v = P / F, then m v^2 / 2 grows with P, then the peak force backwards (all of it taken back).
    corner = power / peak
    first = corner * MASS / peak

    def course(t):
        speed = np.sqrt(corner**2 + 2.0 * power * t / MASS)
        way = corner**2 * MASS / (2.0 * peak) + MASS * (speed**3 - corner**3) / (3.0 * power)
        return way + MASS * speed**2 / (2.0 * peak) - WAY, first + t + MASS * speed / peak

    exact = course(root(lambda t: course(t)[0], 0.0, 5.0))[1]
    assert fine.ok
    assert abs(fine.duration - exact) < 1e-3 * exact
    assert abs(fine.duration - exact) < 0.6 * abs(coarse.duration - exact) + 1e-6
    assert set(fine.problem.system.limits) == {"drive_power_share", "torque_speed", "peak_torque"}


@pytest.mark.parametrize("brake", [150.0, Parameter(150.0)])
def test_brake_limit_holds_too(brake):
    _, free = lift([PowerLimit(220.0), TorqueSpeed((1e6,) * 3, 1e6, (40.0, 300.0, 40.0))])
    _, held = lift([PowerLimit(220.0, brake), TorqueSpeed((1e6,) * 3, 1e6, (40.0, 300.0, 40.0))])
    assert held.duration > 1.02 * free.duration
    power = held.signal("drive_power", held.samples(LINEAR.points)[0])
    assert -150.0 * (1.0 + 1e-6) < np.min(power) < -149.0
    assert np.max(power) < 220.0 * (1.0 + 1e-6)


def test_heat_limits_a_motion():
    motor = MotorDrive((0.1, 0.12, 0.1), 0.9, 0.0, 80.0)
    arm = cylindrical(A=0.0)
    durations = []
    for limit in (None, 305.0):
        system = canonical(arm, [motor, WindingHeat(2.0, 25.0, limit)])
        task = point_to_point(system, [0.0, 0.1, 0.6], [0.0, 0.1 + WAY, 0.6], voltage=48.0)
        solution = solve(task, grid=uniform(30))
        assert solution.ok
        durations.append(solution.duration)
    hottest = np.max(solution.signal("winding_xi", solution.nodes))
    assert hottest == pytest.approx(305.0, abs=1e-3)
    assert durations[1] > 1.05 * durations[0]
    # All the heat of the voltage is in the winding, less what it gave away: by hand from the current.
    t, x, _, _ = solution.samples(np.linspace(0.0, 1.0, 101))
    current = solution.signal("current", t)[:, 1]
    given_off = (solution.signal("winding_xi", t)[:, 0] - 293.15) / 2.0
    assert np.trapezoid(0.9 * current**2 - given_off, t) / 25.0 == pytest.approx(hottest - 293.15, rel=1e-3)
    assert x.shape[1] == 9
