"""Sensitivities: exact derivatives, central differences of tight solves, one-sided cases, refusals."""

from dataclasses import replace
from functools import cache
from math import sqrt

import casadi as ca
import numpy as np
import pytest
from catalogue import problems
from catalogue.spherical_shooting import shoot

import ocp
from models import Parameter, spherical
from models.effects import Gravity, Viscous
from models.forms import canonical
from ocp import Fixed, Free, Held, Ipopt, Problem, System, along, end, polish, radau, sensitivity, solve, start, uniform
from ocp.solving.guess_conversion import from_solution

TIGHT = Ipopt(tol=1e-12)
M, LIMIT, WAY = 2.0, 3.0, 0.7
LEAST = 2.0 * sqrt(M * WAY / LIMIT)
x, u, m = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
SWING = System(x, u, m, ca.vertcat(x[1], (u - 5 * ca.sin(x[0]) - x[1] ** 2) / m), {}, {"m": M})
AXIS = System(x, u, m, ca.vertcat(x[1], u / m), {"q": x[0], "v": x[1], "tau": u}, {"m": M})


def fastest(limit=LIMIT, way=WAY, speed=np.inf):
    """Rest to rest in least time, T = 2 sqrt(m d/u) without a limit of speed."""
    ends = start(x, 0), end(x, [way, 0])
    return Problem(AXIS, Free(1.0), ocp.Bolza(time=1.0), (*ends, along(u, -limit, limit), along(x[1], upper=speed)))


def cheapest(duration=1.2, way=WAY, highest=np.inf, fast=np.inf, system=AXIS):
    """Rest to rest with least effort in a given time, the integral of u^2 = 12 (m d)^2/T^3."""
    ends = start(x, 0), end(x, [way, 0])
    limits = along(u, upper=highest), along(x[1], upper=fast)
    return Problem(system, Fixed(duration), ocp.Bolza(running=u**2), (*ends, *limits))


@pytest.mark.parametrize("finish", [lambda solution: solution, polish], ids=["solved", "polished"])
def test_double_integrator_is_exact(finish):
    solution = finish(solve(fastest(), solver=TIGHT))
    result = sensitivity(solution, toward={"limit": fastest(limit=LIMIT + 1), "way": fastest(way=WAY + 1)})
    exact = {"m": LEAST / (2 * M), "limit": -LEAST / (2 * LIMIT), "way": LEAST / (2 * WAY)}
    assert result.names == ("m", "limit", "way")
    assert dict(result.duration) == pytest.approx(exact, rel=1e-11)
    assert dict(result.cost) == pytest.approx(exact, rel=1e-11)
    assert (result.notes, set(result.valid.values())) == ((), {(True, True)})
    t = np.array([0.11, 0.23, 0.31, 0.43]) * solution.duration
    # x = u t^2/(2 m) and x' = u t/m until the switch; at a share of the duration x = 2 d share^2.
    late = np.stack([-LIMIT * t**2 / (2 * M**2), -LIMIT * t / M**2], axis=1)
    np.testing.assert_allclose(result.x(t, Held.TIME)["m"], late, rtol=1e-9)
    share = t / solution.duration
    np.testing.assert_allclose(result.signal("q", t)["m"][:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(result.signal("q", t)["way"][:, 0], 2 * share**2, rtol=1e-10)
    np.testing.assert_allclose(result.signal(x[0] * m, t)["m"][:, 0], 2 * WAY * share**2, rtol=1e-10)
    np.testing.assert_allclose(result.u(t)["limit"], 1.0, rtol=1e-12)
    np.testing.assert_allclose(result.u(solution.duration * 0.8)["limit"], -1.0, rtol=1e-12)
    if solution.structure is None:
        assert result.switching is None
        with pytest.raises(ValueError, match="polish"):
            result.switches("u")
    else:
        for name, derivative in exact.items():
            np.testing.assert_allclose(result.switches("u")[name], derivative / 2, rtol=1e-11)


def test_multipliers_of_limits_are_derivatives_of_the_cost():
    result = sensitivity(polish(solve(fastest(), solver=TIGHT)))
    cost = {(one.name, one.where.value, one.side): one.cost for one in result.limits}
    assert cost["q", "end", "value"] == pytest.approx(LEAST / (2 * WAY), rel=1e-9)
    # Both limits of the control together are the derivative by their common number, half of it each.
    assert cost["tau", "along", "upper"] == pytest.approx(-LEAST / (4 * LIMIT), rel=1e-9)
    assert cost["tau", "along", "lower"] == pytest.approx(LEAST / (4 * LIMIT), rel=1e-9)


LIMITS = np.array([260.0, 160.0, 3.0, 400.0])


def moved(problem, far):
    """Return the constraints with the first number of the end condition moved."""
    far, parts = np.eye(4)[0] * far, problem.subject_to
    return tuple(replace(c, lower=c.lower + far, upper=c.upper + far) if c.where.value == "end" else c for c in parts)


@cache
def arm():
    machine = spherical(m_3=Parameter(15.0), s_2=Parameter(0.3))
    return canonical(machine, [Gravity(), Viscous(Parameter(0.5))])


def arm_task(more=0.0):
    """The default task of the spherical machine, the third drive stronger by `more`."""
    q = [0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]
    tau = LIMITS + more * np.eye(4)[2]
    return ocp.point_to_point(arm(), [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=tau, q=q)


@cache
def arm_solutions():
    solution = solve(arm_task(), radau(3), uniform(50), TIGHT)
    assert solution.ok
    return solution, polish(solution)


@pytest.mark.parametrize("name", problems.MASSLESS)
def test_machines_with_massless_links_have_the_derivatives_of_a_straight_line(name):
    # A mass m moved straight over d in T by a force f: E = 12 m^2 d^2/T^3 + m^2 g^2 T, f = m (6 d/T^2 (1 - 2 t/T) + g).
    mass, duration, g = 2.0, 1.2, problems.G
    known = problems.straight_line(name, mass=Parameter(mass))
    scheme = radau(3, ocp.Control.COLLOCATED)
    solution = solve(known.problem, scheme, uniform(30), TIGHT, known.guess)
    assert solution.ok
    longer = replace(known.problem, horizon=Fixed(duration + 1.0))
    result = sensitivity(solution, "m_3", {"duration": longer})
    weight = mass**2 * g**2
    way = known.cost - weight * duration  # 12 m^2 d^2/T^3
    assert result.cost["m_3"] == pytest.approx(2.0 * known.cost / mass, rel=1e-6)
    assert result.cost["duration"] == pytest.approx(weight - 3.0 * way / duration, rel=1e-6)
    assert result.duration["duration"] == pytest.approx(1.0, rel=1e-12)
    assert result.duration["m_3"] == pytest.approx(0.0, abs=1e-12)
    # At a share of the duration the path does not depend on the mass, and the force is proportional to it.
    share = np.linspace(0.0, 1.0, 9) * solution.duration
    np.testing.assert_allclose(result.signal("tool", share)["m_3"], 0.0, atol=1e-6)
    np.testing.assert_allclose(result.signal("tool", share)["duration"], 0.0, atol=1e-6)
    tau = solution.signal("tau", share)
    np.testing.assert_allclose(result.signal("tau", share)["m_3"], tau / mass, rtol=0, atol=1e-5 * np.max(np.abs(tau)))


@pytest.mark.slow
def test_polished_spherical_machine_against_shooting():
    best = arm_solutions()[1]
    arcs = best.structure.arcs
    assert any(row.name == "r" for row in best.structure)  # a limit of a state is held
    limits = {f"limit_{i}": limit for i, limit in enumerate(LIMITS, 1)}
    numbers = {**spherical().nominal, "m_3": 15.0, "s_2": 0.3, "viscous.c": 0.5, **limits}
    sides = [[{"lower": -1, "upper": 1, "holding": 0}[kind.value] for kind in arc.kinds] for arc in arcs]
    exact = shoot(numbers, ["m_3", "s_2", "viscous.c", "limit_3"], sides, np.array([arc.duration for arc in arcs]))
    assert best.duration == pytest.approx(np.sum(exact.durations), rel=1e-10)
    np.testing.assert_allclose([arc.duration for arc in arcs], exact.durations, rtol=0, atol=1e-8)
    result = sensitivity(best, toward={"limit": arm_task(1.0)})
    assert result.notes == ()
    middles = np.cumsum([0.0, *(arc.duration for arc in arcs)])[:-1] + [arc.duration / 2 for arc in arcs]
    held = middles[[side[3] == 0 for side in sides]]
    for i, name in enumerate(("m_3", "s_2", "viscous.c", "limit")):
        switches = np.cumsum(exact.slopes[:, i])
        assert result.duration[name] == pytest.approx(switches[-1], rel=1e-7)
        np.testing.assert_allclose(result.switching[name], switches[:-1], rtol=0, atol=1e-6 * np.max(np.abs(switches)))
        force = result.signal("tau", held, Held.ARC)[name][:, 3]
        np.testing.assert_allclose(force, exact.holding[:, i], rtol=0, atol=1e-6 * np.max(np.abs(exact.holding[:, i])))


def test_limit_of_speed_is_held():
    # T = d/v + m v/u, switches at m v/u and d/v; on the grid the rows of the held limit depend on each other.
    speed = 0.6
    solution = solve(fastest(speed=speed), solver=TIGHT)
    toward = {"speed": fastest(speed=speed + 1)}
    exact = {"m": speed / LIMIT, "speed": M / LIMIT - WAY / speed**2}
    best = sensitivity(polish(solution), toward=toward)
    assert best.notes == ()
    assert dict(best.duration) == pytest.approx(exact, rel=1e-10)
    np.testing.assert_allclose(best.switching["speed"], [M / LIMIT, -WAY / speed**2], rtol=1e-10)
    np.testing.assert_allclose(best.switching["m"], [speed / LIMIT, 0.0], rtol=1e-10, atol=1e-12)
    result, step = sensitivity(solution, toward=toward), 1e-5
    tight = [solve(fastest(speed=speed + sign * step), solver=TIGHT).duration for sign in (1, -1)]
    assert result.duration["speed"] == pytest.approx((tight[0] - tight[1]) / (2 * step), rel=1e-5)


@pytest.mark.parametrize(("limit", "exact"), [(0.1, -4 / 0.09), (0.2, -9.6), (0.3, 0.0), (0.25, 0.0)])
def test_bryson_denham_held_touched_free(limit, exact):
    solution = polish(solve(problems.bryson_denham(limit).problem))
    limits = tuple(replace(c, upper=c.upper + 1) if limit in c.upper else c for c in solution.problem.subject_to)
    result = sensitivity(solution, toward={"limit": replace(solution.problem, subject_to=limits)})
    assert result.cost["limit"] == pytest.approx(exact, rel=1e-9, abs=1e-9)
    assert result.duration["limit"] == pytest.approx(0.0, abs=1e-12)
    # A quarter is where the touch begins: it has no multiplier.
    assert result.valid["limit"] == (True, limit != 0.25)
    assert [note for note in result.notes if "the touch of x_1" not in note] == []


def test_limit_that_is_only_just_met_is_told():
    free = solve(cheapest(), solver=TIGHT)
    top = float(free.controls.max())
    met = solve(cheapest(highest=top), solver=TIGHT)
    result = sensitivity(met, toward={"way": cheapest(way=WAY + 1, highest=top)})
    # A longer way or a heavier mass needs more than the limit, a shorter or lighter one less.
    assert result.valid == {"m": (True, False), "way": (True, False)}
    assert len(result.notes) == 2
    assert all("u at its upper limit near t = 0 s" in note and "smaller values only" in note for note in result.notes)
    t = np.linspace(0.01, 0.99, 9) * met.duration
    np.testing.assert_allclose(result.u(t)["way"], free.u(t) / WAY, rtol=1e-5)
    step = 1e-4
    left, right = (solve(cheapest(way=WAY + sign * step, highest=top), solver=TIGHT) for sign in (-1, 1))
    np.testing.assert_allclose((free.u(t) - left.u(t)) / step, result.u(t)["way"], rtol=0, atol=1e-3)
    assert right.u(0.0)[0] == pytest.approx(top, abs=1e-3 * step)  # where the derivative is another one
    assert result.u(0.0)["way"][0] > 1.0


def test_switch_at_an_end_of_an_element_is_one_sided():
    # Half way, by symmetry: to one side of the grid the control of the element before changes, to the other the next.
    problem, step = problems.two_link().problem, 1e-6
    solution, further = solve(problem, solver=TIGHT), lambda far: replace(problem, subject_to=moved(problem, far))
    result = sensitivity(solution, toward={"way": further(1.0)})
    assert result.valid["way"] == (False, True)
    assert "u_1 at its lower limit near t = 1.491 s" in result.notes[0]
    larger, smaller = (solve(further(side), solver=TIGHT, guess=solution).duration for side in (step, -step))
    assert result.duration["way"] == pytest.approx((larger - solution.duration) / step, rel=1e-4)
    assert result.duration["way"] != pytest.approx((solution.duration - smaller) / step, rel=1e-2)


@pytest.mark.parametrize("finish", [lambda solution: solution, polish], ids=["solved", "polished"])
def test_limit_of_the_duration_is_kept(finish):
    # T + c, c ~ m^2 / T^3, with T at its upper limit; polished to the last digit, not shorter or longer.
    def hurried(longest):
        return replace(cheapest(), horizon=Free(1.0, upper=longest), minimise=ocp.Bolza(time=1.0, running=u**2 / 20))

    solution = finish(solve(hurried(0.9), solver=TIGHT))
    result, effort = sensitivity(solution, toward={"longest": hurried(1.9)}), solution.cost - 0.9
    assert solution.duration == pytest.approx(0.9, abs=1e-9)
    assert result.duration["longest"] == pytest.approx(1.0, rel=1e-9)
    assert dict(result.cost) == pytest.approx({"m": 2 * effort / M, "longest": 1 - 3 * effort / 0.9}, rel=1e-7)


def test_limits_that_depend_on_each_other_have_no_derivative():
    # Two equal axes: a longer way of one alone takes longer, a shorter one changes nothing.
    problem = problems.double_integrator_2d().problem
    result = sensitivity(solve(problem), toward={"way": replace(problem, subject_to=moved(problem, 1.0))})
    assert np.isnan([result.duration["way"], result.cost["way"]]).all()
    assert result.valid["way"] == (False, False)
    assert "depend on each other" in result.notes[0]


SCHEMES = radau(3), ocp.legendre(2), ocp.lobatto(3), ocp.lobatto(2, ocp.Control.LINEAR), radau(3, ocp.Control.LINEAR), \
    ocp.legendre(3, ocp.Control.COLLOCATED)  # fmt: skip


@pytest.mark.parametrize("scheme", SCHEMES, ids=repr)
def test_every_scheme_against_differences(scheme):
    prepared, step = ocp.prepare(cheapest(system=SWING), scheme, uniform(12), TIGHT), 1e-4
    solution = prepared()
    result = sensitivity(solution, toward={"duration": cheapest(2.2, system=SWING)})
    assert result.notes == ()
    assert result.duration["duration"] == pytest.approx(1.0)
    share = np.array([0.03, 0.29, 0.61, 0.97])
    for name in ("m", "duration"):
        tasks = ((s * (name == "m"), cheapest(1.2 + s * (name != "m"), system=SWING)) for s in (step, -step))
        one, other = (prepared(solution, {"m": M + s}, task) for s, task in tasks)
        assert result.cost[name] == pytest.approx((one.cost - other.cost) / (2 * step), rel=1e-6)
        for signal in ("x", "u"):
            change = one.signal(signal, share * one.duration) - other.signal(signal, share * other.duration)
            change /= 2 * step
            mine = result.signal(signal, share * solution.duration)[name]
            np.testing.assert_allclose(mine, change, rtol=0, atol=1e-6 * np.max(np.abs(change)))


def test_unknown_parameters_move_too():
    # min T + c^2/2 with the limit c of the control free: T = 2 sqrt(m d/c), c^(5/2) = sqrt(m d).
    c, size = ca.SX.sym("c"), (M * WAY) ** 0.2
    system = System(x, u, ca.vertcat(m, c), ca.vertcat(x[1], u * c / m), {}, {"m": M, "c": 1.0})
    conditions = start(x, 0), end(x, [WAY, 0]), along(u, -1, 1), along(c, 0.1, 10.0)
    solution = polish(solve(Problem(system, Free(1.0), ocp.Bolza(time=1.0, final=c**2 / 2), conditions)))
    result = sensitivity(solution)
    assert result.free["m"]["c"] == pytest.approx(0.2 * size / M, rel=1e-7)
    assert result.duration["m"] == pytest.approx(0.4 * solution.duration / M, rel=1e-7)
    with pytest.raises(ValueError, match="'c' is an unknown of this problem; given parameters are m"):
        sensitivity(solution, ["c"])


def test_refusals_name_the_cure(tmp_path):
    solution = solve(fastest())
    unsolved = solve(fastest(), solver=Ipopt(max_iter=1), guess=from_solution(solution))
    ocp.save(solution, tmp_path / "motion.npz")
    loaded = ocp.load(tmp_path / "motion.npz")
    assert sensitivity(loaded, problem=solution.problem).duration["m"] == pytest.approx(LEAST / (2 * M), rel=1e-9)
    for error, words, wrong in (
        (ValueError, "no parameter 'mass'; there are m", lambda: sensitivity(solution, "mass")),
        (ValueError, "solve it first", lambda: sensitivity(unsolved)),
        (ValueError, "problem=", lambda: sensitivity(loaded)),
        (TypeError, "expected a Solution of a Problem", lambda: sensitivity(fastest())),
        (ValueError, "limits, start and end values", lambda: sensitivity(solution, toward={"other": cheapest()})),
        (ValueError, "a parameter already", lambda: sensitivity(solution, toward={"m": fastest()})),
        (ValueError, "nothing to vary", lambda: sensitivity(solve(problems.double_integrator_2d().problem))),
        (TypeError, "Held", lambda: sensitivity(solution).x(0.0, "time")),
        (KeyError, "no signal 'w'", lambda: sensitivity(solution).signal("w", 0.0)),
    ):
        with pytest.raises(error, match=words):
            wrong()
