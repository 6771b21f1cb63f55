"""Problems as values: what is refused and how, free parameters, prepared NLPs, limits, guesses, scaling."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Grid,
    Guess,
    Ipopt,
    Label,
    Problem,
    Status,
    System,
    along,
    end,
    given,
    legendre,
    point_to_point,
    prepare,
    radau,
    simulate,
    smooth,
    solve,
    start,
    straight_line,
    uniform,
)
from ocp.transcription.scaling import from_limits

nan, inf = float("nan"), float("inf")
x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p")
none = ca.SX(0, 1)
LABELS = {"x": (Label("height", "m"), Label("speed", "m/s")), "u": (Label("force", "N"),)}
axis = System(x, u, p, ca.vertcat(x[1], u / p), {"q": x[0], "v": x[1], "u": u}, {"mass": 2.0}, LABELS)
rest = start(axis["q"], 0), start(axis["v"], 0), end(axis["q"], 1), end(axis["v"], 0)
fastest = Problem(axis, Free(1.0), Bolza(time=1.0), (*rest, along(u, -0.3, 0.3)))
T_FASTEST = 2 * np.sqrt(1.0 * 2.0 / 0.3)
solution = solve(fastest, grid=uniform(6))


def guess(share=(0.0, 1.0), nx=2, rows=2, nu=1, duration=1.0, fill=0.0):
    return Guess(np.array(share), np.full((rows, nx), fill), np.zeros((rows, nu)), duration, np.zeros(0))


REFUSED = {
    # System
    "x no symbols": (lambda: System(2 * x, u, none, x), r"System: x must be made of symbols"),
    "x a list": (lambda: System([1.0], u, none, x), r"System: x is \[1.0\], expected a CasADi SX"),
    "x a row": (lambda: System(x.T, u, none, x), r"System: x has shape \(1, 2\), expected a column"),
    "rate short": (lambda: System(x, u, none, u), r"System: rate has 1 components, x has 2"),
    "rate foreign": (lambda: System(x, u, none, ca.SX.sym("x", 2)), r"rate has symbols .* not in x, u or p.*: x_0"),
    "signal foreign": (lambda: System(x, u, none, x, {"s": ca.SX.sym("b")}), r"signal 's' has symbols .*: b"),
    "signal number": (lambda: System(x, u, none, x, {"s": 1.0}), r"signal 's' is a float, expected"),
    "nominal missing": (lambda: System(x, u, p, x), r"nominal names 0 parameters \(none\), p has 1"),
    "nominal nan": (lambda: System(x, u, p, x, {}, {"mass": nan}), r"mass"),
    "labels short": (lambda: System(x, u, none, x, labels={"x": (Label("a"),)}), r"1 labels for 'x', which has 2"),
    "labels unknown": (lambda: System(x, u, none, x, {"q": x}, labels={"r": ()}), r"no signal 'r'; .* has q"),
    "symbols twice": (lambda: System(x, x, none, x), r"System: .*x"),
    "no signal": (lambda: axis["tau"], r"no signal 'tau'; this system has q, v, u"),
    # horizons and costs
    "fixed zero": (lambda: Fixed(0.0), r"Fixed: duration is 0.0, expected .* > 0"),
    "fixed negative": (lambda: Fixed(-1), r"Fixed: duration is -1, expected"),
    "fixed nan": (lambda: Fixed(nan), r"Fixed: duration is nan"),
    "fixed infinite": (lambda: Fixed(inf), r"Fixed: duration is inf"),
    "fixed word": (lambda: Fixed("1"), r"Fixed: duration is '1'"),
    "free guess": (lambda: Free(0.0), r"Free: guess is 0.0, expected"),
    "free crossed": (lambda: Free(1.0, 2.0, 1.0), r"Free: limits 2.0 .. 1.0 s, expected 0 <= lower <= upper"),
    "free negative": (lambda: Free(1.0, -1.0), r"Free: limits -1.0 .. inf"),
    "free nan": (lambda: Free(1.0, nan), r"Free: lower is nan, expected a number"),
    "free word": (lambda: Free(1.0, "a"), r"Free: .*'?a"),
    "time nan": (lambda: Bolza(time=nan), r"Bolza: time weight is nan, expected a finite number"),
    "time word": (lambda: Bolza(time="a"), r"Bolza: time"),
    "running vector": (lambda: Bolza(running=x), r"Bolza: running has 2 components, expected one"),
    "running word": (lambda: Bolza(running="a"), r"Bolza: running"),
    "running foreign": (lambda: Problem(axis, minimise=Bolza(running=ca.SX.sym("b"))), r"Bolza: running has .*: b"),
    "final control": (lambda: Problem(axis, minimise=Bolza(final=u)), r"Bolza: final depends on the control.*running"),
    # constraints
    "start word": (lambda: start("q", 0), r"start: got 'q', expected an expression such as system\['q'\]"),
    "start size": (lambda: start(x, [1, 2, 3]), r"start: lower has 3 components, expected 1 or 2"),
    "start nan": (lambda: start(x, [1, nan]), r"start: lower is NaN in components \[1\]"),
    "start nothing": (lambda: start(x, None), r"start: .*None"),
    "end word": (lambda: end(x, "a"), r"end: lower is 'a', expected numbers"),
    "along crossed": (lambda: along(x, [0, 1], [1, 0]), r"along: lower > upper in components \[1\]: \[1.0\] > \[0.0\]"),
    "along inverted": (lambda: along(u, lower=inf), r"along: a lower limit of \+inf .* leaves nothing"),
    "along foreign": (lambda: Problem(axis, subject_to=along(ca.SX.sym("x"), 0)), r"along.* symbols .* two symbols"),
    # problems
    "problem system": (lambda: Problem("axis"), r"Problem: system is 'axis', expected"),
    "problem horizon": (lambda: Problem(axis, 1.0), r"Problem: horizon is 1.0, expected .*Free.*Fixed"),
    "problem cost": (lambda: Problem(axis, minimise="time"), r"Problem: minimise is 'time', expected .*Bolza"),
    "problem constraint": (lambda: Problem(axis, subject_to=[1]), r"subject_to has 1, expected start\(...\)"),
    "problem constraints": (lambda: Problem(axis, subject_to=None), r"Problem: subject_to"),
    # grids
    "uniform none": (lambda: uniform(0), r"uniform: got 0, expected a whole number of elements >= 1"),
    "uniform half": (lambda: uniform(2.5), r"uniform: got 2.5"),
    "grid equal": (lambda: given([0, 0.5, 0.5, 1]), r"not increasing at index 2: 0.5 is followed by 0.5"),
    "grid short": (lambda: given([0, 0.9]), r"Grid: runs from 0.0 to 0.9, expected 0 to 1"),
    "grid late": (lambda: given([0.1, 1]), r"Grid: runs from 0.1 to 1.0, expected 0 to 1"),
    "grid nan": (lambda: given([0, nan, 1]), r"Grid: .*"),
    "grid empty": (lambda: Grid([]), r"Grid: got shape \(0,\), expected at least"),
    "grid table": (lambda: given([[0, 1]]), r"Grid: got shape \(1, 2\)"),
    "grid word": (lambda: given("a"), r"Grid: got .*a.*, expected increasing numbers"),
    # solve
    "solve problem": (lambda: solve("fastest"), r"problem: got 'fastest', expected .*Problem"),
    "solve scheme": (lambda: solve(fastest, scheme="radau"), r"scheme: got 'radau', expected .*Scheme"),
    "solve scheme zero": (lambda: solve(fastest, scheme=0), r"scheme: got 0"),
    "solve grid": (lambda: solve(fastest, grid=50), r"grid: got 50, expected .*Grid"),
    "solve grid zero": (lambda: solve(fastest, grid=0), r"grid: got 0"),
    "solve solver": (lambda: solve(fastest, solver="ipopt"), r"solver: got 'ipopt', expected .*Ipopt"),
    "solve guess": (lambda: solve(fastest, guess="line"), r"guess: got 'line', expected a Guess"),
    "solve values": (lambda: solve(fastest, values={"m": 1}), r"no parameter 'm'; this system has mass"),
    "solve value nan": (lambda: solve(fastest, values={"mass": nan}), r"parameter 'mass': got nan, expected a finite"),
    "solve value word": (lambda: solve(fastest, values={"mass": "a"}), r"parameter 'mass': got '?a"),
    "ipopt tol": (lambda: Ipopt(tol=-1.0), r"Ipopt: tol is -1.0, expected a number > 0"),
    "ipopt max_iter": (lambda: Ipopt(max_iter=0), r"Ipopt: max_iter is 0, expected a whole number of iterations >= 1"),
    "ipopt option": (lambda: solve(fastest, solver=Ipopt(extra={"oracle": 1})), r"Ipopt: .*'oracle': 1"),
    "guess states": (lambda: solve(fastest, guess=guess(nx=3)), r"guess: has \(nx, nu\) = \(3, 1\), .* \(2, 1\)"),
    "guess rows": (lambda: solve(fastest, guess=guess(rows=3)), r"[Gg]uess: .*3"),
    "guess backwards": (lambda: solve(fastest, guess=guess(share=(1.0, 0.0))), r"[Gg]uess: share"),
    "guess duration": (lambda: solve(fastest, guess=guess(duration=-1.0)), r"[Gg]uess: duration .*-1"),
    # point_to_point
    "task signal": (lambda: point_to_point(axis, 0, 1, tau=1.0), r"no signal 'tau'; this system has q, v, u"),
    "task magnitude": (lambda: point_to_point(axis, 0, 1, u=-1.0), r"u = -1.0, expected absolute values >= 0 or a"),
    "task word": (lambda: point_to_point(axis, 0, 1, u="a"), r"point_to_point: u"),
    "task limits": (lambda: point_to_point(axis, 0, 1, u=(1, 2, 3)), r"u has 3 components, expected 1"),
    "task crossed": (lambda: point_to_point(axis, 0, 1, u=(1, -1)), r"lower > upper"),
    "task cost": (lambda: point_to_point(axis, 0, 1, minimise="energy"), r"minimise is 'energy', expected 'time'"),
    "task size": (lambda: point_to_point(axis, [0, 1], 1), r"q0 has 2 components, expected 1"),
    "task nowhere": (lambda: point_to_point(axis, None, 1), r"None"),
    "task system": (lambda: point_to_point("axis", 0, 1), r"system.*'axis'"),
    # simulate and solutions
    "simulate x0": (lambda: simulate(axis, [0], [0], 1.0), r"x0: got \[0\], expected 2 finite numbers"),
    "simulate x0 nan": (lambda: simulate(axis, [0, nan], [0], 1.0), r"x0: got \[0, nan\]"),
    "simulate control": (lambda: simulate(axis, [0, 0], [0, 1], 1.0), r"control: got 2 numbers, expected 1"),
    "simulate function": (lambda: simulate(axis, [0, 0], lambda t: [0, 1], 1.0), r"control: .* 2 numbers, expected 1"),
    "simulate times": (lambda: simulate(axis, [0, 0], [0], [1.0, 0.5]), r"times: .*increasing"),
    "simulate back": (lambda: simulate(axis, [0, 0], [0], -1.0), r"times: .*-1"),
    "simulate beyond": (lambda: simulate(axis, [0, 0], solution, [0, 99.0]), r"times: .*99"),
    "simulate rtol": (lambda: simulate(axis, [0, 0], [0], 1.0, rtol=0), r"rtol, atol: got 0, .* > 0"),
    "simulate atol": (lambda: simulate(axis, [0, 0], [0], 1.0, atol=[1, 1, 1]), r"atol"),
    "simulate values": (lambda: simulate(axis, [0, 0], [0], 1.0, values={"m": 1}), r"no parameter 'm'; .* mass"),
    "motion over": (lambda: solution.x(99.0), r"t: got 99.0 .. 99.0 s, the motion lasts from 0 to"),
    "motion nan": (lambda: solution.x(nan), r"t: got nan"),
    "motion signal": (lambda: solution.signal("tau", 0.0), r"no signal 'tau'; this system has q, v, u"),
    "motion symbol": (lambda: solution.signal(ca.SX.sym("b"), 0.0), r"signal has symbols .*: b"),
    "motion number": (lambda: solution.signal(3, 0.0), r"signal: got 3"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_refused(what):
    make, words = REFUSED[what]
    with pytest.raises((TypeError, ValueError, KeyError), match=words):
        make()


def test_system_with_labels_and_values():
    assert [str(label) for label in axis.label("x", 2)] == ["height [m]", "speed [m/s]"]
    assert [str(label) for label in axis.label("tool", 2)] == ["tool_1", "tool_2"]
    assert axis.values() == [2.0]
    assert axis.values({"mass": 3}) == [3.0]


def test_limits_of_several_constraints_intersect():
    both = replace(fastest, subject_to=(along(x, -1, [2, 3]), along(x[1], -5, 1), end(x, 0)))
    low, high = both.limits(both.subject_to[0].where, x)
    np.testing.assert_array_equal([low, high], [[-1, -1], [2, 1]])


def test_straight_line_meets_the_ends():
    ends = start(x[0] * x[1], 1.0), start(x[0] + x[1], 2.0), end(x, [3.0, -1.0])
    made = straight_line(Problem(axis, Fixed(2.0), Bolza(running=u**2), ends), [2.0])
    np.testing.assert_allclose(made.x[[0, -1]], [[1.0, 1.0], [3.0, -1.0]], atol=1e-5)
    assert made.duration == 2.0


def test_smooth_guess_follows_the_system():
    made = smooth(Problem(axis, Fixed(2.0), Bolza(running=u**2), rest), [2.0])
    s = made.share
    position = s**3 * (10 - 15 * s + 6 * s**2)
    speed, force = 30 * s**2 * (1 - s) ** 2 / 2.0, 2.0 * 60 * s * (1 - s) * (1 - 2 * s) / 2.0**2
    np.testing.assert_allclose(made.x[:, 0], position, atol=1e-12)
    np.testing.assert_allclose(made.x[:, 1], speed, atol=0.01)
    np.testing.assert_allclose(made.u[2:-2, 0], force[2:-2], atol=0.05)


def test_guess_meets_ends_that_have_no_meaning_at_zero():
    ends = start(x[0], 2.0), start(x[1] / x[0], 0.0), end(x, [3.0, 0.0])
    made = straight_line(Problem(axis, Fixed(2.0), Bolza(running=u**2), ends), [2.0])
    np.testing.assert_allclose(made.x[0], [2.0, 0.0], atol=1e-12)


# min u^2/2 integrated + (a - 3)^2/2, x' = u, x(0) = 0, x(T) = a, T = 2: a^2/(2 T) + (a - 3)^2/2 is least at a = 2.
y, a = ca.SX.sym("y"), ca.SX.sym("a")
reach = System(y, u, a, u, nominal={"a": 0.5})
reaching = Problem(
    reach, Fixed(2.0), Bolza(running=u**2 / 2, final=(a - 3) ** 2 / 2), (start(y, 0), end(y - a, 0), along(u, -9, 9))
)


@pytest.mark.parametrize(("limit", "best", "cost"), [(9.0, 2.0, 1.5), (1.0, 1.0, 2.25)])
def test_parameter_as_unknown(limit, best, cost):
    found = solve(replace(reaching, subject_to=(*reaching.subject_to, along(a, -limit, limit))), grid=uniform(5))
    assert found.ok
    assert found.free == {"a": pytest.approx(best, abs=1e-6)}
    assert found.values == found.free
    assert found.cost == pytest.approx(cost, abs=1e-6)


def test_parameter_as_number():
    prepared = prepare(reaching, grid=uniform(5))
    for value in (0.5, -1.25, 4.0):
        found = prepared(values={"a": value})
        assert found.cost == pytest.approx(value**2 / 4 + (value - 3) ** 2 / 2, abs=1e-7)
        assert (found.free, found.values) == ({}, {"a": value})


def assert_same(found, fresh):
    assert found.ok
    assert fresh.ok
    assert found.duration == pytest.approx(fresh.duration, rel=1e-7)
    assert found.cost == pytest.approx(fresh.cost, rel=1e-7)
    np.testing.assert_allclose(found.states, fresh.states, rtol=0, atol=1e-5)


def test_prepared_for_other_numbers():
    grid = uniform(12)
    prepared = prepare(fastest, grid=grid)
    for mass in (1.0, 5.0):
        found = prepared(values={"mass": mass})
        assert found.duration == pytest.approx(2 * np.sqrt(mass / 0.3), rel=1e-6)
        assert_same(found, solve(fastest, grid=grid, values={"mass": mass}))
    other = replace(
        fastest,
        horizon=Free(5.0, 1.0, 20.0),
        subject_to=(start(axis["q"], 0.5), start(axis["v"], 0), end(axis["q"], -1), end(axis["v"], 0), along(u, -2, 1)),
    )
    assert_same(prepared(problem=other), solve(other, grid=grid))
    stretched = given(np.linspace(0, 1, 13) ** 1.3)
    assert_same(prepared(grid=stretched), solve(fastest, grid=stretched))
    assert_same(prepared(), solve(fastest, grid=grid))


def test_prepared_for_another_fixed_duration():
    effort = Problem(axis, Fixed(2.0), Bolza(running=u**2), (*rest, along(u, -50, 50)))
    found = prepare(effort, radau(3, Control.COLLOCATED), uniform(5))(problem=replace(effort, horizon=Fixed(3.0)))
    assert found.duration == 3.0
    assert found.cost == pytest.approx(12 * 2.0**2 / 3.0**3, rel=1e-7)


@pytest.mark.parametrize(
    "changes",
    [
        {"horizon": Fixed(1.0)},
        {"minimise": Bolza(time=2.0)},
        {"subject_to": rest},
        {"subject_to": (*rest, along(u / p, -0.3, 0.3))},
        {"subject_to": (*rest[:3], start(axis["v"], 0), along(u, -0.3, 0.3))},
    ],
    ids=["horizon", "cost", "fewer", "expression", "place"],
)
def test_prepared_refuses_another_structure(changes):
    with pytest.raises(ValueError, match=r"differs from the prepared one .* prepare it anew"):
        prepare(fastest, grid=uniform(4))(problem=replace(fastest, **changes))


def test_prepared_refuses_a_grid_of_another_size():
    with pytest.raises(ValueError, match=r"grid: has 5 elements, .* prepared for 4"):
        prepare(fastest, grid=uniform(4))(grid=uniform(5))


def test_point_to_point_is_the_problem_written_out():
    short = point_to_point(axis, 0, 1, u=0.3, v=(-1.0, 5.0), q=([-2.0], [2.0]))
    assert_same(solve(short, grid=uniform(12)), solve(fastest, grid=uniform(12)))
    assert solve(short, grid=uniform(12)).duration == pytest.approx(T_FASTEST, rel=1e-6)
    assert len(short.subject_to) == 7


@pytest.mark.parametrize(
    ("constraints", "words"),
    [
        ((start(x, [0.0, 0.0]), along(x[0], 1.0, 2.0)), "height"),
        ((*rest, along(x[1], 0.5, 1.0)), "speed"),
        ((*rest, start(x[0], 0.25)), "height"),
        ((*rest, along(u, 1, 2), along(u, 3, 4)), "force"),
    ],
    ids=["start", "ends", "twice", "control"],
)
def test_contradictory_limits_are_a_solution_that_says_so(constraints, words):
    found = solve(replace(fastest, subject_to=constraints), grid=uniform(4))
    assert found.status is Status.INFEASIBLE
    assert not found.ok
    assert words in found.message


def test_too_short_a_duration_is_a_solution_that_says_so():
    found = solve(replace(fastest, horizon=Fixed(4.0)), grid=uniform(4))
    assert found.status is Status.INFEASIBLE
    assert np.all(np.isfinite(found.states))


def test_limit_of_iterations_keeps_the_last_iterate():
    found = solve(fastest, grid=uniform(20), solver=Ipopt(max_iter=3), guess=guess())
    assert found.status is Status.LIMIT
    assert found.iterations == 3
    assert np.all(np.isfinite(found.states))
    assert np.ptp(found.controls) > 0.0
    assert found.solver_status == "Maximum_Iterations_Exceeded"


@pytest.mark.parametrize("control", [Control.CONSTANT, Control.LINEAR])
@pytest.mark.parametrize("make", [radau, legendre])
def test_control_never_exceeds_its_limits(make, control):
    found = solve(fastest, make(3, control), uniform(15))
    assert found.ok
    values = found.u(np.linspace(0.0, found.duration, 3001))
    assert np.max(np.abs(values)) <= 0.3
    assert np.max(np.abs(values)) > 0.3 - 1e-6


def test_solution_as_guess_on_another_grid_and_scheme():
    known = solve(fastest, grid=uniform(20))
    for scheme, grid in ((radau(3), uniform(30)), (legendre(2, Control.LINEAR), uniform(20)), (radau(5), uniform(8))):
        found = solve(fastest, scheme, grid, guess=known)
        assert found.ok
        assert found.duration == pytest.approx(solve(fastest, scheme, grid).duration, rel=1e-6)
        assert found.duration == pytest.approx(T_FASTEST, rel=5e-3)


def test_scaling_is_by_powers_of_two_near_the_limits():
    problem = replace(fastest, subject_to=(*rest, along(x, [-1.5, -7.0], [1.0, 2.0]), along(u, -0.3, 0.2)))
    made = from_limits(problem, straight_line(problem, [2.0]), [2.0], np.zeros(0, dtype=int))
    np.testing.assert_array_equal(made.x, [2.0, 8.0])
    np.testing.assert_array_equal(made.u, [0.25])
    assert made.horizon == 1.0


def test_rounding_in_a_guess_sets_no_scale():
    z = ca.SX.sym("z", 2)
    problem = Problem(System(z, u, none, ca.vertcat(u, 1e-17 * z[0])), Fixed(2.0), subject_to=(start(z, 0),))
    noisy = Guess(
        np.array([0.0, 1.0]), np.array([[0.0, 3e-17], [1.0, -2e-17]]), np.full((2, 1), 1e-16), 2.0, np.zeros(0)
    )
    made = from_limits(problem, noisy, [], np.zeros(0, dtype=int))
    assert made.x[1] > 1e-6
    assert made.u[0] > 1e-6


@pytest.mark.parametrize("limits", [(), (along(u, -900, 900),)], ids=["no limits", "limits"])
def test_scaling_does_not_change_the_optimum(limits):
    # At rest with nothing to balance: the controls of the guess are rounding errors and set no scale.
    integrator = System(y, u, none, u)
    problem = Problem(integrator, Fixed(2.0), Bolza(running=y**2 + u**2), (start(y, 1.4), *limits))
    scaled, plain = (solve(problem, grid=uniform(10), solver=Ipopt(scaled=scaled)) for scaled in (True, False))
    assert scaled.ok
    assert plain.ok
    assert scaled.cost == pytest.approx(plain.cost, rel=1e-7)
    np.testing.assert_allclose(scaled.states, plain.states, rtol=0, atol=1e-6)
