"""Sequences are polished, refined, searched and differentiated like single problems; exact values by hand."""

import pickle

import casadi as ca
import numpy as np
import pytest

import ocp
from models import torus
from models.effects import Gravity
from models.forms import canonical
from ocp import Bolza, Problem, Sequence, System, along, end, estimate, polish, solve, solve_to_accuracy, start, uniform

X, U, M = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("m")
AXIS = System(X, U, M, ca.vertcat(X[1], U / M), {"q": X[0], "v": X[1], "tau": U}, {"m": 2.0})
SLOW, FAST, M_0 = 0.6, 0.9, 2.0


def course(fast=FAST):
    """From rest over 1 m with |u| <= 1 and v <= 0.6, then over 2 m to rest with |u| <= 2 and v <= `fast`."""
    one = Problem(AXIS, subject_to=(start(X, 0.0), end(X[0], 1.0), along(U, -1, 1), along(X[1], upper=SLOW)))
    other = Problem(AXIS, subject_to=(end(X, [3.0, 0.0]), along(U, -2, 2), along(X[1], upper=fast)))
    return Sequence((one, other))


def durations(m=M_0, fast=FAST):
    """Return the least durations of both phases: speed up, go on at the limit, and brake in the second one."""
    first = SLOW * m + (1.0 - SLOW**2 * m / 2.0) / SLOW
    gained, braked = (fast**2 - SLOW**2) * m / 4.0, fast**2 * m / 4.0
    second = (fast - SLOW) * m / 2.0 + fast * m / 2.0 + (2.0 - gained - braked) / fast
    return np.array([first, second])


@pytest.fixture(scope="module")
def solved():
    result = solve(course(), grid=uniform(20))
    assert result.ok
    return result


@pytest.fixture(scope="module")
def polished(solved):
    return polish(solved)


def test_polish_finds_the_exact_durations_and_switches(polished):
    t_1, t_2 = durations()
    np.testing.assert_allclose([phase.duration for phase in polished.phases], [t_1, t_2], rtol=1e-11)
    assert polished.cost == pytest.approx(t_1 + t_2, rel=1e-12)
    ups, brake = SLOW * M_0, t_1 + t_2 - FAST * M_0 / 2.0
    again = t_1 + (FAST - SLOW) * M_0 / 2.0
    np.testing.assert_allclose(polished.structure.switches("u"), [ups, t_1, again, brake], rtol=1e-9)
    assert [str(row.kind) for row in polished.structure] == ["upper", "holding"] * 2 + ["lower", "limit", "limit"]
    assert ocp.verify(polished).ok


def test_the_whole_motion_is_read_like_one_solution(polished):
    t_1, t_2 = durations()
    np.testing.assert_allclose(polished.x(SLOW * M_0 / 2.0), [SLOW**2 * M_0 / 8.0, SLOW / 2.0], rtol=1e-9)
    np.testing.assert_allclose(polished.x([0.0, t_1 + t_2])[:, 0], [0.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(polished.u(0.1), 1.0)
    # dT/dq = -1 / v while the limit of speed is held, and H = -1 in both phases.
    np.testing.assert_allclose(polished.costate(t_1 - 0.01)[0], -1.0 / SLOW, rtol=1e-9)
    np.testing.assert_allclose(polished.costate(t_1 + 0.5)[0], -1.0 / FAST, rtol=1e-9)
    assert len(polished.error) == 2 * len(polished.grid)


@pytest.mark.parametrize("finish", [lambda solution: solution, polish], ids=["solved", "polished"])
def test_sensitivities(solved, finish):
    tight = solve(course(), grid=uniform(20), solver=ocp.Ipopt(tol=1e-12)) if finish is not polish else solved
    result = ocp.sensitivity(finish(tight), toward={"fast": course(FAST + 1.0)})
    assert result.names == ("m", "fast")
    if finish is polish:
        exact = {"m": [SLOW / 2.0, 0.6 - (0.45 + 0.81) / 4.0 / FAST], "fast": [0.0, 1.0 - 2.18 / FAST**2]}
        for name, each in exact.items():
            np.testing.assert_allclose(result.durations[name], each, atol=1e-9)
            assert result.cost[name] == pytest.approx(sum(each), rel=1e-9)
            assert result.duration[name] == pytest.approx(sum(each), rel=1e-9)
        # v = u t / m at a fixed share of the first duration
        share = 0.3 * SLOW * M_0 / durations()[0]
        change = 0.3 * SLOW * M_0 / durations()[0] * (SLOW / 2.0) / M_0 - 0.3 * SLOW / M_0
        np.testing.assert_allclose(result.signal("v", share, 0)["m"], change, atol=1e-9)
        return
    # On a grid of constant controls: against solves on the same grid.
    step = 1e-4
    for name, values, fast in (("m", step, 0.0), ("fast", 0.0, step)):
        one, other = (
            solve(course(FAST + sign * fast), grid=uniform(20), solver=ocp.Ipopt(tol=1e-12), guess=tight,
                  values={"m": M_0 + sign * values}).cost for sign in (1.0, -1.0)
        )  # fmt: skip
        assert result.cost[name] == pytest.approx((one - other) / (2.0 * step), rel=1e-4)


def test_the_error_is_estimated(solved):
    errors = estimate(solved)
    true = solved.cost - durations().sum()
    assert true < errors.cost < 6.0 * true
    assert errors.duration == pytest.approx(errors.cost, rel=1e-3)


@pytest.mark.parametrize("tol", [1e-3, ocp.Seconds(1e-3), ocp.Signal("q", 1e-6)], ids=["cost", "seconds", "signal"])
def test_refinement_meets_its_tolerance(tol):
    *_, last = solve_to_accuracy(course(), tol)
    assert last.accuracy.met
    assert abs(last.cost - durations().sum()) <= last.accuracy.errors.cost
    if not isinstance(tol, ocp.Signal):
        assert abs(last.cost - durations().sum()) < 1e-3


def test_refinement_ends_with_polish():
    *_, last = solve_to_accuracy(course(), 1e-9, finish=polish)
    assert last.accuracy.met
    assert last.duration == pytest.approx(durations().sum(), rel=1e-11)
    assert last.structure is not None


def test_other_optima_of_a_sequence():
    """A mass in a plane passes a disc that lies a little below the straight way: above it is shorter."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
    plane = System(x, u, None, ca.vertcat(x[2:], u), {"q": x[:2], "v": x[2:], "tau": u})
    kept = along(u, -1, 1), ocp.outside(ocp.Ball((1.0, -0.1), 0.4), x[:2])
    one = Problem(plane, subject_to=(start(x, 0.0), end(x[0], 2.0), *kept))
    other = Problem(plane, subject_to=(end(x, [3.0, 0.0, 0.0, 0.0]), *kept))
    result = ocp.multistart(Sequence((one, other)), 8, grid=uniform(15))
    assert sum(optimum.hits for optimum in result) >= 6
    assert "starts" in result.message
    best = result[0].solution
    assert best.problem is not None
    assert ocp.verify(best).status == "SOLVED"
    assert [optimum.solution.cost for optimum in result] == sorted(optimum.solution.cost for optimum in result)


def test_laps_are_closed():
    """Slow over the first metre, fast over the second; a lap ends as fast as it begins."""
    one = Problem(AXIS, subject_to=(start(X[0], 0.0), end(X[0], 1.0), along(U, -1, 1), along(X[1], upper=SLOW)))
    other = Problem(AXIS, subject_to=(end(X[0], 2.0), along(U, -2, 2), along(X[1], upper=FAST)))
    *_, lap = solve_to_accuracy(Sequence((one, other), closing="v"), 1e-5)
    change = (FAST - SLOW) * M_0 / 2.0
    exact = 1.0 / SLOW + 2.0 * change + (1.0 - (FAST**2 - SLOW**2) * M_0 / 2.0) / FAST
    assert lap.accuracy.met
    assert abs(lap.duration - exact) < 1e-5
    assert ocp.verify(lap).ok
    np.testing.assert_allclose(lap.signal("v", lap.duration), lap.signal("v", 0.0), rtol=1e-8)
    assert solve(Sequence((one, other)), grid=uniform(20)).duration < exact - 0.01


def test_an_unknown_parameter_is_one_number_for_all_phases():
    """Two metres in two stops take 4 sqrt(m); a penalty of 2^2.5 / m on the mass makes 2 kg the best one."""
    stops = along(M, 1.0, 5.0), along(U, -1, 1)
    penalised = Bolza(time=1.0, final=2.0**2.5 / M)
    one = Problem(AXIS, minimise=penalised, subject_to=(start(X, 0.0), end(X, [1.0, 0.0]), *stops))
    other = Problem(AXIS, subject_to=(end(X, [2.0, 0.0]), *stops))
    result = solve(Sequence((one, other)), grid=uniform(20))
    assert result.ok
    assert [phase.free["m"] for phase in result.phases] == pytest.approx([2.0, 2.0], rel=1e-4)
    assert result.cost == pytest.approx(4.0 * np.sqrt(2.0) + 2.0**1.5, rel=1e-6)
    assert polish(result).cost == pytest.approx(4.0 * np.sqrt(2.0) + 2.0**1.5, rel=1e-9)


def test_sequences_that_close_travel_and_refuse_bad_links():
    one, other = course().problems
    travelled = pickle.loads(pickle.dumps(Sequence((one, other), closing=("v",))))
    assert travelled.closing == ("v",)
    assert len(travelled.junctions) == 2
    with pytest.raises(TypeError, match="closing"):
        Sequence((one, other), closing=(3,))
    with pytest.raises(KeyError):
        Sequence((one, other), closing=("speed",))
    with pytest.raises(ValueError, match="phase"):
        ocp.sensitivity(solve(course(), grid=uniform(8))).signal("v", 0.5, 2)


@pytest.mark.slow
def test_a_motion_over_a_via_point_is_polished_below_a_fine_grid():
    arm = canonical(torus(), [Gravity()])
    limits = along(arm["q"], [-3.0, -0.3, -2.6], [3.0, 2.0, 2.6]), along(arm["tau"], *(s * TAU for s in (-1.0, 1.0)))
    one = Problem(
        arm,
        subject_to=(start(arm["q"], [0.0, 0.4, -0.9]), start(arm["v"], 0), end(arm["q"], [1.0, 0.2, -0.8]), *limits),
    )
    other = Problem(arm, subject_to=(end(arm["q"], [2.0, 0.8, -1.3]), end(arm["v"], 0.0), *limits))
    best = polish(solve(Sequence((one, other)), grid=uniform(40)), seconds=100.0)
    assert best.structure is not None
    assert len(best.structure.switches("tau_q1")) == 1  # at full torque through the point
    assert ocp.verify(best).ok
    fine = solve(Sequence((one, other)), grid=uniform(400), guess=best)
    assert best.cost < fine.cost < best.cost * (1.0 + 1e-5)


TAU = np.array([250.0, 600.0, 220.0])
