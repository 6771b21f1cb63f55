"""Polished solutions: known optima to their last digits, structures, costates of limits, refusals."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from catalogue import problems, published
from time_optimal import TASKS

from models import recover
from models.effects import Gravity
from models.forms import canonical, hamel
from ocp import (
    Control,
    Solution,
    legendre,
    load,
    lobatto,
    point_to_point,
    polish,
    radau,
    save,
    solve,
    uniform,
    verify,
)
from ocp.arcs.arc_nlp import prepare_arcs
from ocp.arcs.arc_problems import arc_problem
from ocp.arcs.arcs import durations
from ocp.arcs.polishing import SETTINGS
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solving.guess_conversion import from_solution

SIX = legendre(6, Control.COLLOCATED)
OTHER = {"legendre8": legendre(8, Control.COLLOCATED), "radau7": radau(7, Control.COLLOCATED)}
FORMS = {"canonical": canonical, "hamel": hamel}
LOWER, UPPER, INTERIOR, HOLDING = Kind.LOWER, Kind.UPPER, Kind.INTERIOR, Kind.HOLDING
EXACT = {
    "COPS arm": problems.cops,
    "Luus arm": problems.two_link,
    "lift up": problems.lift_fastest,
    "lift down": lambda: problems.lift_fastest(up=False),
    "lift up slow": lambda: problems.lift_fastest(speed=1.2),
    "lift down slow": lambda: problems.lift_fastest(up=False, speed=1.2),
    "lift weightless": lambda: problems.lift_fastest(g=0.0),
    "double integrator": problems.double_integrator_2d,
    "brachistochrone": problems.brachistochrone,
    "least effort": problems.lift_cheapest,
    "compromise": problems.lift_compromise,
    "Bryson-Denham held": lambda: problems.bryson_denham(0.1),
    "Bryson-Denham limit case": lambda: problems.bryson_denham(1 / 6),
    "Bryson-Denham touched": lambda: problems.bryson_denham(0.2),
    "Bryson-Denham touched lightly": lambda: problems.bryson_denham(0.24),
    "Bryson-Denham free": lambda: problems.bryson_denham(0.3),
    **{f"line {name}": lambda name=name: problems.straight_line(name) for name in problems.MASSLESS},
}
# The default tasks, and one of the cylindrical machine whose turning drive is so weak that the arm is drawn in.
TASKS = {**TASKS, "cylindrical": replace(TASKS["cylindrical"], limit=(60.0, 1000.0, 300.0))}


@cache
def polished(name):
    known = EXACT[name]()
    coarse = solve(known.problem, grid=uniform(50), guess=known.guess)
    assert coarse.ok
    return known, coarse, polish(coarse, seconds=100.0)


def assert_polished(solution):
    assert solution.ok
    assert solution.structure is not None, solution.message
    assert "; polished: " in solution.message
    report = verify(solution)
    assert report.ok, report
    assert report.drift < 1e-9
    assert report.violation < 1e-9
    assert not report.switching > 1e-7  # NaN where limits couple the controls
    return report


@pytest.mark.parametrize("name", EXACT)
def test_known_optimum_after_one_coarse_solve(name):
    known, coarse, solution = polished(name)
    # On 50 elements all are wrong by more than the polished ones may be, but those whose switches lie between elements.
    exact = name in ("double integrator", "lift weightless", "Bryson-Denham free")
    assert (abs(coarse.cost - known.cost) < 1e-7) is exact
    assert solution.cost == pytest.approx(known.cost, rel=1e-11 if name == "brachistochrone" else 1e-9, abs=1e-9)
    report = assert_polished(solution)
    if known.problem.minimise.time and not known.problem.minimise.running.nnz():
        assert solution.cost == solution.duration
        assert report.hamiltonian_value == pytest.approx(-1.0, abs=1e-8)
    assert report.hamiltonian < 1e-6


@pytest.mark.parametrize("name", [name for name in EXACT if EXACT[name]().switches and "slow" not in name])
def test_known_switching_times(name):
    known, _, solution = polished(name)
    labels = solution.problem.system.label("u", len(known.switches))
    for label, expected in zip(labels, known.switches, strict=True):
        assert solution.structure.switches(label.name) == pytest.approx(expected, abs=1e-7)
        assert {row.kind for row in solution.structure if row.name == label.name} == {LOWER, UPPER}


@pytest.mark.parametrize("up", [True, False])
def test_limit_of_speed_is_held_between_the_known_times(up):
    known, _, solution = polished(f"lift {'up' if up else 'down'} slow")
    faster, slower = (20.0 - 9.81, 20.0 + 9.81) if up else (20.0 + 9.81, 20.0 - 9.81)
    times = 1.2 / faster, known.cost - 1.2 / slower
    assert solution.structure.switches("u") == pytest.approx(times, abs=1e-9)
    held = solution.structure[-1]
    assert (held.name, held.kind) == ("x_2", Kind.LIMIT)
    assert (held.start, held.end) == pytest.approx(times, abs=1e-9)
    middle = np.linspace(times[0] + 1e-6, times[1] - 1e-6, 9)
    np.testing.assert_allclose(solution.u(middle), 3.0 * 9.81, rtol=1e-9)  # the drive carries the weight
    np.testing.assert_allclose(solution.x(middle)[:, 1], 1.2 if up else -1.2, rtol=1e-12)


def costates(solution):
    """Return points, seen from inside their elements, and the costates there."""
    tau = np.array([0.1, 0.5, 0.9])
    found = np.einsum("sd,kda->ksa", solution.scheme.costate_at(tau), solution.costates)
    return solution.samples(tau)[0], found.reshape(-1, solution.costates.shape[2])


def test_costates_of_a_held_limit():
    # lambda_2 = -u, lambda_1 = -lambda_2'; both vanish on the limit, so that lambda_1 jumps at its ends.
    limit, solution = 0.1, polished("Bryson-Denham held")[2]
    t, found = costates(solution)
    left, right = np.maximum(1 - t / (3 * limit), 0), np.maximum(1 - (1 - t) / (3 * limit), 0)
    expected = np.array([np.sign(left) - np.sign(right), 3 * limit * (left + right)]) * 2 / (9 * limit**2)
    np.testing.assert_allclose(found.T, expected, rtol=0, atol=1e-4)  # 5e-6 of the largest
    # The control arrives with its slope zero, so that the cost hardly says when.
    assert solution.structure.switches("u") == pytest.approx((3 * limit, 1 - 3 * limit), abs=5e-5)


def test_costates_of_a_touched_limit():
    limit, solution = 0.2, polished("Bryson-Denham touched")[2]
    (touch,) = [row for row in solution.structure if row.kind is Kind.TOUCH]
    assert (touch.name, touch.start, touch.end) == ("x_1", pytest.approx(0.5, abs=1e-8), touch.start)
    t, found = costates(solution)
    slope = 24 * (1 - 4 * limit)
    expected = np.array([slope * np.sign(0.5 - t), 2 + slope / 4 - slope * np.minimum(t, 1 - t)])
    np.testing.assert_allclose(found.T, expected, rtol=0, atol=5e-6)  # 1e-6 of the largest


def solved_arcs(limit, arcs, elements):
    problem = problems.bryson_denham(limit).problem
    guess = from_solution(solve(problem, grid=uniform(30)))
    nlp = prepare_arcs(arc_problem(problem, SIX, {}), arcs, elements, guess, SETTINGS)
    return nlp.solve(nlp.start(guess, durations(arcs)))


def test_multipliers_of_a_held_limit():
    held = Contact(0, 1, 0)
    arcs = Arc((INTERIOR,), 0.28), Arc((HOLDING,), 0.44, (held,)), Arc((INTERIOR,), 0.28)
    motion = solved_arcs(0.1, arcs, (2, 1, 2))
    np.testing.assert_allclose([arc.duration for arc in motion.arcs], [0.3, 0.4, 0.3], rtol=0, atol=5e-5)
    np.testing.assert_allclose(motion.limit_multipliers[0].values, 0.0, atol=1e-6)  # none between its ends
    sizes = {jump.arc: jump.height for jump in motion.jumps}
    assert sizes == {1: pytest.approx(2 / 0.09, rel=2e-6), 2: pytest.approx(2 / 0.09, rel=2e-6)}


def test_multiplier_of_a_touched_limit():
    motion = solved_arcs(0.2, (Arc((INTERIOR,), 0.4), Arc((INTERIOR,), 0.6, (), (Contact(0, 1),))), (2, 2))
    assert motion.arcs[0].duration == pytest.approx(0.5, abs=1e-9)
    (jump,) = motion.jumps
    assert jump.height == pytest.approx(48 * (1 - 4 * 0.2), rel=1e-7)


def test_singular_arc_without_chatter():
    problem, switch, size, cost = problems.regulator()
    assert cost == pytest.approx(0.37699, abs=1e-5)
    solution = polish(solve(problem, grid=uniform(50)), seconds=100.0)
    assert_polished(solution)
    assert solution.cost == pytest.approx(cost, rel=1e-9)
    assert [row.kind for row in solution.structure] == [LOWER, INTERIOR]
    assert solution.structure.switches("u") == pytest.approx((switch,), abs=2e-4)
    t = np.linspace(switch + 0.01, 4.99, 200)
    np.testing.assert_allclose(solution.u(t)[:, 0], size * np.cosh(t - 5.0), rtol=0, atol=1e-2)  # the range is 2
    summary = "singular arcs regularised by a penalty of "
    assert summary in solution.message
    assert float(solution.message.split(summary)[1].split()[0]) < 1e-10


def coarse_task(name, form, **changes):
    task, effects = replace(TASKS[name], **changes), [Gravity()]
    machine = task.machine()
    arm = FORMS[form](machine, effects)
    problem = point_to_point(arm, task.q0, task.q1, q=(task.q_min, task.q_max), tau=task.limit)
    return solve(problem, grid=uniform(50)), arm, machine, effects


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_machine_with_an_active_limit(name):
    found = []
    for form, scheme in (("canonical", SIX), ("hamel", OTHER["legendre8"]), ("canonical", OTHER["radau7"])):
        coarse, arm, machine, effects = coarse_task(name, form)
        solution = polish(coarse, scheme=scheme, seconds=100.0)
        report = assert_polished(solution)
        assert report.hamiltonian < 1e-6
        assert report.hamiltonian_value == pytest.approx(-1.0, abs=1e-8)
        _, x, rate, u = solution.samples(solution.scheme.points)
        p = np.array(list(solution.values.values()))[:, None]
        torques = np.array(recover(arm, machine, effects).map(len(x))(x.T, rate.T, np.tile(p, len(x)))[-1]).T
        np.testing.assert_allclose(torques / TASKS[name].limit, u / TASKS[name].limit, rtol=0, atol=1e-7)
        found.append(solution)
    durations = [solution.duration for solution in found]
    assert np.ptp(durations) < 1e-8
    assert 1e-5 < coarse.duration - durations[0] < 1e-3  # what one switch inside an element costs
    kinds = [[(row.name, row.kind) for row in solution.structure] for solution in found]
    assert kinds[0] == kinds[1] == kinds[2]
    assert kinds[0][-1][1] in (Kind.LIMIT, Kind.TOUCH)


def assert_unchanged(solution, coarse):
    assert solution.structure is None
    assert solution.message.startswith(f"{coarse.message}; not polished: ")
    for name in ("states", "controls", "costates", "duration", "cost", "grid", "scheme", "status", "timings"):
        assert getattr(solution, name) is getattr(coarse, name), name


@pytest.mark.slow
def test_curved_limit_of_several_controls_is_the_reason_not_to_polish():
    known = problems.straight_line("torus", fastest=True)
    coarse = solve(known.problem, grid=uniform(30), guess=known.guess)
    assert coarse.ok
    solution = polish(coarse)
    assert solution.structure is None
    assert "is curved in several controls" in solution.message
    assert known.cost < solution.cost < coarse.cost  # on a moved grid


def test_a_limit_held_by_a_saturated_drive_is_polished():
    # The radial drive saturates while it holds the limit; the turning one has to hold the speed then.
    coarse = coarse_task("cylindrical", "canonical", limit=(150.0, 1000.0, 300.0))[0]
    solution = polish(coarse, seconds=120.0)
    assert solution.structure is not None, solution.message
    assert solution.cost == pytest.approx(0.7163582, abs=2e-6)  # constant controls on a moved grid of 75 elements
    report = verify(solution)
    assert report.ok
    assert report.violation < 1e-5


def test_a_limit_of_third_order_is_touched_only():
    known = published.PUBLISHED["Robbins"]
    solution = polish(solve(known.make(), grid=uniform(50)))
    assert solution.structure is not None, solution.message
    assert not any(row.kind is Kind.LIMIT for row in solution.structure)
    assert solution.cost == pytest.approx(known.value, rel=3e-7)  # 19.43178 by a convex QP of 4000 elements


def test_unsolved_solution_is_returned_with_the_reason():
    known = problems.lift_fastest()
    coarse = replace(solve(known.problem, grid=uniform(10)), status=type(polished("lift up")[1].status).LIMIT)
    solution = polish(coarse)
    assert solution.structure is None
    assert solution.message.endswith("not polished: it is not a solved one")


def test_loaded_solution_needs_its_problem(tmp_path):
    known, coarse, solution = polished("lift up")
    save(coarse, tmp_path / "coarse.npz")
    loaded = load(tmp_path / "coarse.npz")
    with pytest.raises(ValueError, match=r"polish: .* pass problem="):
        polish(loaded)
    again = polish(loaded, problem=known.problem)
    assert isinstance(again, Solution)
    assert again.duration == pytest.approx(solution.duration, rel=1e-12)
    assert again.structure.rows == solution.structure.rows


@pytest.mark.parametrize("wrong", [None, 1.0, "motion.npz"])
def test_wrong_solution_is_refused(wrong):
    with pytest.raises(TypeError, match="expected a Solution"):
        polish(wrong)


@pytest.mark.parametrize("scheme", [radau(3), legendre(3), radau(3, Control.LINEAR), lobatto(4, Control.COLLOCATED), 6])
def test_wrong_scheme_is_refused(scheme):
    with pytest.raises(TypeError, match=r"scheme is .*, expected"):
        polish(polished("lift up")[1], scheme=scheme)


def test_timings_are_those_of_polishing():
    solution = polished("COPS arm")[2]
    spent = solution.timings
    assert spent.total == pytest.approx(spent.setup + spent.derivatives + spent.solver)
    assert min(spent.setup, spent.derivatives, spent.solver) > 0.0
    assert solution.rung == "polish"
