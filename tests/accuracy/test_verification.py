"""Verification: small figures for a good solution, and the right figure grows when a solution is damaged."""

import ast
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from models import cylindrical
from models.effects import Gravity
from models.forms import canonical
from ocp import (
    Allowed,
    Bolza,
    Control,
    Fixed,
    Free,
    Ipopt,
    Label,
    Problem,
    Status,
    System,
    along,
    end,
    legendre,
    lobatto,
    point_to_point,
    radau,
    save,
    solve,
    start,
    uniform,
    verify,
)
from ocp.solution.figure import Figure
from ocp.solution.storage import load

x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
none = ca.SX(0, 1)
LABELS = {"x": (Label("height", "m"), Label("speed", "m/s")), "u": (Label("force", "N"),)}
ENERGY = {"energy": x[1] ** 2 / 2 + 9.81 * x[0], "power": u * x[1]}
lift = System(x, u, none, ca.vertcat(x[1], u - 9.81), ENERGY, {}, LABELS)
FASTEST = Problem(lift, Free(1.0), Bolza(time=1.0), (start(x, 0), end(x, [0.8, 0]), along(u, -20, 20)))
good = solve(FASTEST, grid=uniform(30))
report = verify(good)


def damaged(**changes):
    return verify(replace(good, **changes))


def scaled(array, factor, element=slice(None)):
    changed = np.array(array)
    changed[element] *= factor
    return changed


def test_good_solution():
    assert good.ok
    assert report.ok
    assert report.failures == ()
    assert report.drift < 1e-10
    assert report.drift_end <= report.drift
    assert report.violation == 0.0
    assert report.hamiltonian < 0.05
    assert report.hamiltonian_value == pytest.approx(-1.0, abs=1e-6)
    assert 0.0 <= report.switching < 1e-2
    assert report.energy < 1e-10
    assert all(figure == 0.0 for figure in report.excess)


def test_figures_say_what_they_are():
    for name in ("drift", "drift_end", "violation", "hamiltonian", "switching", "energy"):
        figure = getattr(report, name)
        assert isinstance(figure, Figure)
        assert figure.unit == "share"
        assert figure.scale.startswith(("the ", "a "))
        assert figure.scale in str(figure)
        assert name in str(report)
    assert str(report).endswith("\nverified")
    units = [figure.unit for figure in report.excess]
    assert units == ["m", "m/s", "m", "m/s", "N"]
    assert {figure.scale for figure in report.excess} == {"start limit", "end limit", "along limit"}
    assert str(Figure(0.25, "m", "end limit", "height", 1.5)) == "2.50e-01 m of end limit (height at 1.5 s)"


@pytest.mark.parametrize("make", [radau, legendre, lobatto])
@pytest.mark.parametrize("control", Control)
def test_good_solutions_of_all_schemes(make, control):
    # Constant force on each element: the motion is a polynomial of degree two, exact for all.
    limits = start(x, 0), end(x, [0.8, 0])
    result = solve(Problem(lift, Fixed(0.7), Bolza(running=u**2), limits), make(3, control), uniform(20))
    assert verify(result).drift < 1e-9
    assert verify(result).energy < 1e-9
    assert verify(result).violation < 1e-9


def test_moved_states_drift():
    k = 12
    states = np.array(good.states)
    states[k, 1:-1, 0] += 1e-3
    assert damaged(states=states).drift == pytest.approx(report.drift, abs=1e-9)  # inside: nodes alone are compared
    states[k, -1, 0] += 1e-3
    states[k + 1, 0, 0] += 1e-3
    result = damaged(states=states)
    top = np.max(np.abs(good.states[:, :, 0]))
    assert result.drift == pytest.approx(1e-3 / top, rel=1e-6)
    assert (result.drift.what, result.drift.at) == ("height", pytest.approx(good.nodes[k + 1]))
    assert result.drift_end < 1e-9
    assert any(
        "the re-integrated motion drifts away" in sentence and "height" in sentence for sentence in result.failures
    )
    assert "not verified" in str(result)


def test_changed_control_drifts():
    result = damaged(controls=scaled(good.controls, 0.9, 0))
    assert result.drift > 1e-2
    assert result.drift_end > 1e-2
    assert not result.ok


def test_changed_duration_drifts():
    result = damaged(duration=1.001 * good.duration)
    assert result.drift > 1e-4
    assert any("drifts away" in sentence for sentence in result.failures)


def test_exceeded_limit_is_a_violation():
    result = damaged(controls=scaled(good.controls, 1.1, 3))
    assert result.violation == pytest.approx(0.1 * 20 / 40, rel=1e-4)
    assert result.violation.what == "force"
    assert good.nodes[3] <= result.violation.at <= good.nodes[4]
    assert result.excess[-1] == pytest.approx(2.0, rel=1e-4)
    assert any("a limit is exceeded" in sentence and "force" in sentence for sentence in result.failures)


def test_limit_between_points_is_looked_at():
    # The interpolant of two values within the limits leaves them outside of its points.
    result = solve(FASTEST, radau(3, Control.COLLOCATED), uniform(7))
    beyond = np.max(np.abs(result.u(np.linspace(0.0, result.duration, 5001)))) - 20.0
    assert beyond > 0.1
    assert verify(result).excess[-1] == pytest.approx(beyond, rel=0.05)
    assert not verify(result).ok


def test_the_defects_of_the_transcription_play_no_part():
    # A scheme whose defect equations are not even numbers, but whose interpolants are those of the solve.
    nothing = np.full_like(good.scheme.state, np.nan), np.full_like(good.scheme.rate, np.nan)
    other = verify(replace(good, scheme=replace(good.scheme, state=nothing[0], rate=nothing[1])))
    assert str(other) == str(report)


def test_verification_imports_neither_the_nlp_nor_the_solver():
    room = Path(__file__).resolve().parents[2] / "ocp" / "accuracy"
    imported = set()
    for name in ("verification", "optimality_figures", "even_multipliers", "report"):
        for node in ast.walk(ast.parse((room / f"{name}.py").read_text(encoding="utf-8"))):
            imported |= {node.module} if isinstance(node, ast.ImportFrom) else set()
    foreign = ("ocp.transcription", "ocp.solving", "ocp.arcs", "ocp.sensitivities", "ocp.accuracy.error_estimate")
    # Of the scheme only the shape of the control, which says where multipliers of state limits are a saw-tooth.
    assert {name for name in imported if name.startswith(foreign)} == {"ocp.transcription.schemes.scheme"}


def test_missed_ends_are_violations():
    states = np.array(good.states)
    states[0, 0, 0], states[-1, -1, 0] = 0.02, 0.83
    result = damaged(states=states)
    assert result.excess[0] == pytest.approx(0.02)
    assert result.excess[2] == pytest.approx(0.03)
    assert result.violation.what == "height"


def test_scaled_costates_show_in_the_hamiltonian():
    result = damaged(costates=1.5 * good.costates)
    assert result.hamiltonian_value == pytest.approx(-1.5, abs=1e-3)
    assert result.hamiltonian > 0.25
    assert any("Hamiltonian" in sentence for sentence in result.failures)


def test_turned_costates_show_in_the_switching_function():
    # Every bang is now at the wrong limit: the gain is the integral of |lambda_v| times the range of 40.
    result = damaged(costates=-good.costates)
    weights = (good.duration * good.grid.widths[:, None] * good.scheme.weights)[:, :, None]
    assert result.switching == pytest.approx(
        np.sum(weights * np.abs(good.costates[:, :, 1:])) * 40.0 / good.cost, rel=0.01
    )
    assert any("switching functions leave a gain" in sentence for sentence in result.failures)


def test_control_off_its_limit_shows_in_the_switching_function():
    # 10 N less than the limit on three elements at the start, where the drive lifts.
    result = damaged(controls=scaled(good.controls, 0.5, slice(0, 3)))
    weights = (good.duration * good.grid.widths[:, None] * good.scheme.weights)[:3]
    added = np.sum(weights * np.abs(good.costates[:3, :, 1])) * 10.0 / good.cost
    assert result.switching == pytest.approx(report.switching + added, rel=1e-6)
    assert any("switching functions leave a gain" in sentence for sentence in result.failures)


def test_failed_solver_is_a_failure():
    result = damaged(status=Status.LIMIT)
    assert result.failures == ("the solver ended with LIMIT",)
    assert not result.ok


def test_states_that_are_no_numbers():
    states = np.array(good.states)
    states[4, 1, 0] = np.nan
    result = damaged(states=states)
    assert np.isnan(result.drift)
    assert not result.ok


def test_open_energy_balance():
    wrong = System(x, u, none, lift.rate, {**ENERGY, "power": 1.01 * u * x[1]}, {}, LABELS)
    result = verify(replace(good, problem=replace(FASTEST, system=wrong)))
    assert result.energy > 1e-3
    assert any("energy balance" in sentence for sentence in result.failures)


def test_losses_close_the_energy_balance():
    rough = System(x, u, none, ca.vertcat(x[1], u - 9.81 - 3.0 * x[1]), {**ENERGY, "loss": 3.0 * x[1] ** 2}, {}, LABELS)
    result = verify(solve(replace(FASTEST, system=rough), grid=uniform(30)))
    assert result.energy < 1e-9
    del rough.signals["loss"]
    assert verify(solve(replace(FASTEST, system=rough), grid=uniform(30))).energy > 1e-2


def test_energy_without_signals_is_undefined():
    bare = System(x, u, none, lift.rate)
    result = verify(solve(replace(FASTEST, system=bare), grid=uniform(30)))
    assert np.isnan(result.energy)
    assert result.energy.what == "undefined"
    assert result.ok


def test_state_that_stays_zero_has_no_drift():
    # Its rate is a rounding error, and so is the state: no scale to measure a drift by.
    z = ca.SX.sym("z", 3)
    idle = System(z, u, none, ca.vertcat(z[1], u, ca.sin(z[0]) ** 2 + ca.cos(z[0]) ** 2 - 1))
    task = Problem(idle, Free(1.0), subject_to=(start(z, 0), end(z[:2], [1, 0]), along(u, -1, 1)))
    result = solve(task, grid=uniform(10))
    assert np.max(np.abs(result.states[:, :, 2])) < 1e-15
    assert verify(result).drift < 1e-9


def test_machine_is_verified():
    arm = canonical(cylindrical(), [Gravity()])
    task = point_to_point(arm, [0, 0.2, 0.8], [1.0, 0.5, 0.6], tau=[60.0, 900.0, 120.0])
    result = verify(solve(task, grid=uniform(40)))
    assert result.ok, str(result)
    assert result.energy < 1e-8


def test_loaded_solution_needs_its_problem(tmp_path):
    save(good, tmp_path / "good.npz")
    loaded = load(tmp_path / "good.npz")
    with pytest.raises(ValueError, match=r"verify: .* loaded without its problem; pass problem="):
        verify(loaded)
    assert float(verify(loaded, FASTEST).drift) == float(report.drift)


def test_unfinished_solution_is_not_verified():
    stopped = solve(FASTEST, grid=uniform(30), solver=Ipopt(max_iter=2))
    assert not verify(stopped).ok
    assert "LIMIT" in verify(stopped).failures[0]


def test_the_local_error_follows_the_order_of_the_scheme():
    # x' = x has the solution exp(t); the residual of a polynomial of degree d is of order d, its integral d + 1.
    x, u = ca.SX.sym("x"), ca.SX.sym("u", 0)
    growth = Problem(System(x, u, ca.SX(0, 1), x), Fixed(1.0), Bolza(final=x), (start(x, 1.0),))
    for scheme in (radau(2), radau(3), legendre(2)):
        coarse, fine = (np.max(solve(growth, scheme, uniform(n)).error) for n in (5, 10))
        assert np.log2(coarse / fine) == pytest.approx(scheme.degree + 1, abs=0.3)
    solution = solve(growth, radau(2), uniform(5))
    # By hand on the last element: x' - x of the parabola through the three values, integrated with many points.
    t = np.linspace(0.8, 1.0, 20001)
    parabola = np.polynomial.Polynomial.fit([0.8, 0.8 + 0.2 / 3.0, 1.0], solution.states[-1, :, 0], 2)
    residual = np.abs(parabola.deriv()(t) - parabola(t))
    by_hand = np.trapezoid(residual, t) / np.max(solution.states)
    # The quadrature has a kink to cross where the residual has a further zero.
    assert solution.error[-1] == pytest.approx(by_hand, rel=0.02)


@pytest.mark.parametrize("control", [Control.CONSTANT, Control.LINEAR])
def test_interior_controls_of_a_curved_cost_leave_no_gain(control):
    # min of the integral of u^2: u = 6 - 12 t by theory, cost 12, far within the limits. Steps of 1/20 miss its slope
    # of 12 by 12 (t - middle): the integral of that squared is 12^2 / (12 * 20^2) = 0.03, and this is the gain.
    rest = System(x, u, none, ca.vertcat(x[1], u), labels=LABELS)
    task = Problem(rest, Fixed(1.0), Bolza(running=u**2), (start(x, 0), end(x, [1, 0]), along(u, -100, 100)))
    result = verify(solve(task, radau(3, control=control), uniform(20)))
    assert result.ok, str(result)
    assert result.switching == pytest.approx(0.03 / 12.0 if control is Control.CONSTANT else 0.0, abs=1e-4)
    assert damaged_gain(task, control) > 0.02


def damaged_gain(task, control):
    """Return the gain that a control half as large leaves: u^2 / 4 of it, 12 / 4 of 12."""
    solution = solve(task, radau(3, control=control), uniform(20))
    return verify(replace(solution, controls=solution.controls / 2.0)).switching


def test_what_is_allowed_is_an_argument_and_failures_say_amount_and_cure():
    coarse = solve(FASTEST, grid=uniform(7))
    report = verify(coarse, allowed=Allowed(switching=1e-4))
    assert not report.ok
    assert set(report.cures) == {"switching"}
    # The exact minimum: rising with 20 - 9.81, falling with 20 + 9.81.
    exact = np.sqrt(2.0 * 0.8 * (1.0 / 10.19 + 1.0 / 29.81))
    amount, unit = report.amounts["switching"].split()
    assert unit == "s"
    assert float(amount) == pytest.approx(report.switching * coarse.cost, rel=0.1)
    assert coarse.cost - exact <= 1.1 * float(amount)
    assert "polish(solution)" in report.failures[0]
    assert report.amounts["switching"] in report.failures[0]
    assert verify(coarse, allowed=Allowed(switching=1.0)).ok


def test_a_drift_is_stated_in_the_unit_of_its_state_and_with_elements_that_cure_it():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    labels = {"x": (Label("angle", "rad"), Label("rate", "rad/s"))}
    stiff = System(x, u, rate=ca.vertcat(x[1], 40.0 * ca.sin(x[0]) + u), labels=labels)
    problem = Problem(stiff, Fixed(1.0), Bolza(running=u**2), (start(x, [0.1, 0.0]), end(x, [3.0, 0.0])))
    coarse = solve(problem, grid=uniform(20))
    report = verify(coarse)
    words = next(words for words in report.failures if "drifts" in words)
    assert "that is" in words
    assert "rad" in words
    more = report.more_elements("drift")
    assert f"about {more} elements more" in words
    assert verify(solve(problem, grid=uniform(20 + more))).drift < report.allowed.drift


@pytest.mark.parametrize("wrong", [{"drift": 0.0}, {"violation": -1.0}, {"energy": np.nan}])
def test_what_is_allowed_is_checked(wrong):
    with pytest.raises(ValueError, match="Allowed"):
        Allowed(**wrong)
    with pytest.raises(TypeError, match="Allowed"):
        verify(good, allowed=1e-3)
