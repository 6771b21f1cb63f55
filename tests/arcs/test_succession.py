"""Structures carried over: equal to polishing each neighbour, refused or revised where the structure changes."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from math import sqrt

import casadi as ca
import numpy as np
import pytest
from catalogue import problems
from time_optimal import TASKS

from models import Parameter, spherical, torus
from models.effects import Gravity, Payload
from models.forms import canonical
from ocp import (
    Bolza,
    Control,
    Fixed,
    Free,
    Ipopt,
    Problem,
    Status,
    Study,
    along,
    legendre,
    load,
    point_to_point,
    polish,
    prepare,
    prepare_structure,
    save,
    solve,
    start,
    straight_line,
    uniform,
    verify,
)
from ocp.arcs.arc_nlp import prepare_arcs
from ocp.arcs.arc_problems import arc_problem
from ocp.arcs.arcs import durations, key_of
from ocp.arcs.polishing import SETTINGS
from ocp.problem.constraints import Where, simple
from ocp.solution.structure import Arc, Kind
from ocp.solving.guess_conversion import from_solution

EXACT = replace(SETTINGS, tol=1e-12)
MACHINES = {"spherical": lambda: spherical(m_3=Parameter(15.0)), "torus": torus}


@cache
def arm_of(name):
    return canonical(MACHINES[name](), [Gravity(), Payload(Parameter(0.2))])


def motion(name, strength=1.0):
    task = TASKS[name]
    limit = strength * np.array(task.limit)
    return point_to_point(arm_of(name), task.q0, task.q1, q=(task.q_min, task.q_max), tau=limit)


@cache
def carried(name):
    return prepare_structure(polish(solve(motion(name)), solver=EXACT))


def changed(problem, limits, horizon=None):
    """Return a problem with other limits on its controls, given by a function of the ones that it has."""
    own = [k.where is Where.ALONG and simple(k, problem.system.u) for k in problem.subject_to]
    constraints = [
        replace(k, lower=limits(k.lower), upper=limits(k.upper)) if mine else k
        for k, mine in zip(problem.subject_to, own, strict=True)
    ]
    return Problem(problem.system, horizon or problem.horizon, problem.minimise, tuple(constraints))


def assert_same(found, reference, tol=1e-9):
    assert found.ok, found.message
    assert found.rung == "structure carried over"
    assert [(r.name, r.kind) for r in found.structure] == [(r.name, r.kind) for r in reference.structure]
    assert found.duration == pytest.approx(reference.duration, rel=0, abs=1e-9)
    assert found.cost == pytest.approx(reference.cost, rel=1e-9)
    times, expected = ([r.start for r in one.structure] for one in (found, reference))
    np.testing.assert_allclose(times, expected, rtol=0, atol=tol)


def assert_refused(found, words):
    assert found.structure is None
    assert not found.ok
    assert words in found.message
    assert "not carried over: " in found.message


@pytest.mark.parametrize(
    ("name", "values", "strength"),
    [
        ("spherical", {"m_3": 15.15}, 1.0),
        ("spherical", {"m_3": 14.3}, 1.0),
        ("spherical", {"payload.mass": 0.0}, 1.0),
        ("spherical", None, 1.05),
        ("spherical", None, 0.95),
        ("torus", {"payload.mass": 0.25}, 0.97),
    ],
)
def test_neighbour_is_the_one_that_polish_finds_from_nothing(name, values, strength):
    problem = motion(name, strength)
    found = carried(name)(values, problem)
    assert_same(found, polish(solve(problem, values=values), solver=EXACT))
    report = verify(found)
    assert report.ok, report
    assert report.drift < 1e-9
    assert report.violation < 1e-9


@pytest.mark.parametrize("name", ["cops", "two_link", "lift_compromise", "lift_cheapest"])
def test_known_problems_with_other_limits(name):
    problem = getattr(problems, name)().problem
    carry = prepare_structure(polish(solve(problem), solver=EXACT))
    for strength in (0.96, 1.03):
        there = changed(problem, lambda side, factor=strength: factor * side)
        assert_same(carry(problem=there), polish(solve(there), solver=EXACT))


@pytest.mark.parametrize("up", [True, False])
def test_held_limit_follows_its_value(up):
    problem = problems.lift_fastest(up=up, speed=1.2).problem
    carry = prepare_structure(polish(solve(problem)))
    last = None
    for speed in (1.25, 1.3, 1.1, 0.9):
        known = problems.lift_fastest(up=up, speed=speed)
        sides = [(k.lower, k.upper) for k in known.problem.subject_to]
        same = [replace(k, lower=a, upper=b) for k, (a, b) in zip(problem.subject_to, sides, strict=True)]
        last = carry(problem=replace(problem, subject_to=tuple(same)), guess=last)
        assert last.duration == pytest.approx(known.cost, rel=1e-12)
        faster, slower = (20.0 - 9.81, 20.0 + 9.81) if up else (20.0 + 9.81, 20.0 - 9.81)
        times = speed / faster, known.cost - speed / slower
        assert last.structure.switches("u") == pytest.approx(times, abs=1e-11)
        assert last.iterations <= 6


def test_touched_limit_follows_its_value():
    problem = problems.bryson_denham(0.2).problem
    carry = prepare_structure(polish(solve(problem)))
    for limit in (0.19, 0.21, 0.24):
        known = problems.bryson_denham(limit)
        there = [replace(k, upper=np.where(np.isfinite(k.upper), limit, k.upper)) if k.where is Where.ALONG else k
                 for k in problem.subject_to]  # fmt: skip
        found = carry(problem=replace(problem, subject_to=tuple(there)))
        assert found.ok, found.message
        assert found.cost == pytest.approx(known.cost, rel=1e-10)
        assert found.structure[-1].kind is Kind.TOUCH
        assert found.structure[-1].start == pytest.approx(0.5, abs=1e-9)


def test_given_duration_follows_its_value():
    problem = replace(problems.lift_cheapest(0.7).problem)
    carry = prepare_structure(polish(solve(problem)))
    for duration in (0.6, 0.75):
        found = carry(problem=replace(problem, horizon=Fixed(duration)))
        assert found.duration == pytest.approx(duration, rel=1e-12)
        assert found.cost == pytest.approx(problems.lift_cheapest(duration).cost, rel=1e-10)


@pytest.mark.parametrize("side", ["upper", "lower"])
def test_polish_keeps_the_limits_of_a_free_duration(side):
    eps, way = 1e-3, 3.0 * 0.8
    free = problems.lift_compromise(eps)
    best = sqrt(sqrt(36.0 * eps * way**2))
    limit = best * (0.8 if side == "upper" else 1.2)
    there = replace(free.problem, horizon=Free(guess=limit, **{side: limit}))
    solution = polish(solve(there))
    assert solution.structure is not None, solution.message
    assert solution.duration == pytest.approx(limit, rel=1e-8)
    assert solution.cost == pytest.approx(limit + eps * 12.0 * way**2 / limit**3, rel=1e-8)


def test_polish_leaves_nothing_to_its_barrier():
    # With limits in the NLP a touch is 1.2e-8 s late here; the cost does not show it.
    solution = polish(solve(motion("torus")))
    assert solution.structure[-1].kind is Kind.TOUCH
    task = arc_problem(solution.problem, solution.scheme, solution.values)
    elements = tuple(np.bincount(next(iter(prepare_structure(solution).nlps.values())).owner).tolist())
    finer = replace(SETTINGS, tol=1e-13)
    limited = prepare_arcs(task, solution.structure.arcs, elements, from_solution(solution), finer)
    arcs = limited.solve(limited.restart(solution)).arcs
    np.testing.assert_allclose(durations(solution.structure.arcs), durations(arcs), rtol=0, atol=1e-10)


def test_few_newton_steps():
    carry = carried("spherical")
    assert carry({"m_3": 14.9}).iterations <= 4
    assert carry({"m_3": 14.25}).iterations <= 5
    again = carry(guess=carry({"m_3": 14.9}), values={"m_3": 14.9})
    assert again.iterations == 1


def test_switches_that_change_places_revise_the_structure():
    # At 15.2 kg the radial drive leaves the limit before the third one switches, at 15 kg after it.
    carry, values = carried("spherical"), {"m_3": 15.6}
    found = carry(values)
    assert "times revised" in found.message
    order = [[arc.kinds for arc in one.structure.arcs] for one in (found, carry.origin)]
    assert order[0] != order[1]
    assert_same(found, polish(solve(motion("spherical"), values=values), solver=EXACT))
    # The revised structure is what the next neighbour begins with.
    after = carry({"m_3": 15.8}, guess=found)
    assert after.ok
    assert "revised" not in after.message


@pytest.mark.slow
@pytest.mark.parametrize("chained", [False, True])
def test_sweep_across_changes_of_structure_accepts_nothing_wrong(chained):
    problem, last, accepted, compared, structures = motion("spherical"), None, 0, 0, set()
    carry = prepare_structure(carried("spherical").origin)
    for mass in np.linspace(11.0, 19.0, 20):
        values = {"m_3": float(mass)}
        found = carry(values, guess=last if chained else None)
        if found.structure is None:
            assert not found.ok
            continue
        accepted, last = accepted + 1, found
        assert verify(found).ok
        structures.add(tuple(arc.kinds for arc in found.structure.arcs))
        coarse = solve(problem, values=values)
        assert found.cost < coarse.cost
        reference = polish(coarse, solver=EXACT, seconds=100.0)
        if reference.structure is None:
            continue
        # Near a change of structure the reference may lack an arc of a tenth of a millisecond, or leave 1e-6 open.
        assert found.cost < reference.cost + 1e-9
        same = key_of(found.structure.arcs) == key_of(reference.structure.arcs)
        if same and found.cost == pytest.approx(reference.cost, rel=0, abs=1e-9):
            compared += 1
            assert_same(found, reference, 1e-8)  # a revised structure may have other elements
    assert accepted >= 15
    assert compared >= 12  # polish gives up on some of the others
    assert len(structures) >= 3


def far_away(path):
    """Solve in another process, on a model of its own, from a file."""
    origin = load(path, problem=motion("spherical"))
    found = prepare_structure(origin)({"m_3": 15.6, "payload.mass": 0.1}, motion("spherical", 1.01))
    return found.message, found.duration, found.states.tobytes(), found.controls.tobytes(), found.costates.tobytes()


def test_same_numbers_elsewhere_and_whatever_was_solved_before(tmp_path):
    carry, values, problem = carried("spherical"), {"m_3": 15.6, "payload.mass": 0.1}, motion("spherical", 1.01)
    save(carry.origin, tmp_path / "origin.npz")
    for mass in (12.0, 18.0):
        carry({"m_3": mass})
    here = carry(values, problem)
    assert here.ok, here.message
    expected = here.message, here.duration, here.states.tobytes(), here.controls.tobytes(), here.costates.tobytes()
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(far_away, str(tmp_path / "origin.npz")).result() == expected
    assert far_away(tmp_path / "origin.npz") == expected


def test_guess_may_come_from_a_file_and_decides_the_structure(tmp_path):
    carry = carried("spherical")
    near = carry({"m_3": 15.6})
    save(near, tmp_path / "near.npz")
    found = [carry({"m_3": 15.7}, guess=guess) for guess in (near, load(tmp_path / "near.npz"))]
    assert found[0].duration == found[1].duration
    np.testing.assert_array_equal(found[0].states, found[1].states)
    assert [arc.kinds for arc in found[0].structure.arcs] == [arc.kinds for arc in near.structure.arcs]


def test_neighbour_with_a_system_of_its_own_is_transcribed_anew():
    task = TASKS["spherical"]
    arm = canonical(spherical(m_3=14.9), [Gravity(), Payload(Parameter(0.2))])
    other = canonical(spherical(m_3=15.0), [Gravity(), Payload(Parameter(0.2))])
    there, here = (
        point_to_point(a, task.q0, task.q1, q=(task.q_min, task.q_max), tau=task.limit) for a in (arm, other)
    )
    found = prepare_structure(polish(solve(here), solver=EXACT))({"payload.mass": 0.25}, there)
    assert found.problem is there
    reference = carried("spherical")({"m_3": 14.9, "payload.mass": 0.25})
    assert_same(found, reference)
    assert found.timings.setup > reference.timings.setup


def lift(mass):
    return problems.lift_fastest(mass=mass, speed=1.2).problem  # each with a system of its own


def test_study_of_systems_of_their_own_carries_structures_over():
    table = Study(lift, over={"mass": [3.0, 3.05, 3.1, 3.15]}, polished=True, checked=0.0).run()
    assert [result.status for result in table.records] == ["solved"] * 4
    assert sum(result.way == "carried" for result in table.records) == 3
    for result in table.records:
        mass = dict(result.parameters)["mass"]
        assert result.results["duration"] == pytest.approx(problems.lift_fastest(mass=mass, speed=1.2).cost, rel=1e-11)


def test_far_neighbour_is_refused_with_the_reason():
    found = carried("spherical")({"m_3": 150.0})
    assert_refused(found, "")
    assert found.values["m_3"] == 150.0
    assert found.status is not Status.SOLVED


def test_singular_arcs_are_refused():
    carry = prepare_structure(polish(solve(problems.regulator()[0])))
    assert_refused(carry(), "singular arcs")


def test_limit_that_appears_is_refused():
    problem = problems.lift_cheapest().problem
    carry = prepare_structure(polish(solve(problem)))
    assert_refused(carry(problem=replace(problem, horizon=Free(1.0, upper=0.6))), "limit of the duration appears")
    fast = problems.lift_fastest().problem
    carry = prepare_structure(polish(solve(fast)))
    assert_refused(carry(problem=changed(fast, lambda side: np.where(side > 0.0, np.inf, side))), "a limit appears or")


def test_guess_without_structure_is_refused():
    carry = carried("spherical")
    assert_refused(carry(guess=replace(carry.origin, structure=None)), "the guess has no structure")


def test_wrong_arguments():
    carry, coarse = carried("spherical"), solve(problems.lift_fastest().problem, grid=uniform(10))
    with pytest.raises(TypeError, match="expected a polished Solution"):
        prepare_structure(None)
    with pytest.raises(ValueError, match="has no structure"):
        prepare_structure(coarse)
    with pytest.raises(ValueError, match="loaded without its problem"):
        prepare_structure(replace(carry.origin, problem=None))
    with pytest.raises(TypeError, match="guess: got 'x', expected a Solution"):
        carry(guess="x")
    with pytest.raises(ValueError, match="guess: has"):
        carry(guess=coarse)
    with pytest.raises(ValueError, match="no parameter 'm_4'"):
        carry({"m_4": 1.0})
    with pytest.raises(ValueError, match="in more than limits"):
        carry(problem=problems.lift_fastest().problem)
    with pytest.raises(TypeError, match="problem: got 3"):
        carry(problem=3)


def test_maximum_on_the_way_is_no_minimum():
    # One unknown more than equations: the motion through a given middle, whose cost the sign of eps turns round.
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    axis = problems.system(x, u, u)
    for sign, solved in ((1.0, True), (-1.0, False)):
        problem = Problem(axis, Fixed(1.0), Bolza(final=sign * (x - 0.3) ** 2), (start(x, 0), along(u, -1, 1)))
        arcs = Arc((Kind.LOWER,), 0.4), Arc((Kind.UPPER,), 0.6)
        task = arc_problem(problem, legendre(3, Control.COLLOCATED), {})
        guess = straight_line(problem, [])
        nlp = prepare_arcs(task, arcs, (1, 1), guess, SETTINGS, limited=False)
        assert nlp.equations is not None
        motion = nlp.solve(nlp.start(guess, durations(arcs)))
        assert (motion.result.status is Status.SOLVED) is solved, motion.result.verbatim
        if solved:
            assert [arc.duration for arc in motion.arcs] == pytest.approx([0.35, 0.65], abs=1e-12)
        else:
            assert "no minimum" in motion.result.verbatim


def test_timings_are_those_of_the_call():
    found = carried("spherical")({"m_3": 14.9})
    spent = found.timings
    assert spent.total == pytest.approx(spent.setup + spent.derivatives + spent.solver)
    assert min(spent.setup, spent.derivatives, spent.solver) > 0.0


def test_solver_settings_are_taken():
    carry = prepare_structure(polish(solve(problems.bryson_denham(0.1).problem)), solver=Ipopt(max_iter=1, tol=1e-16))
    assert_refused(carry(), "the NLP of these arcs is not solved")


def test_prepared_nlp_takes_the_same_cost_stated_again():
    first, again = motion("spherical"), motion("spherical", 0.9)
    assert first.minimise is not again.minimise
    prepared = prepare(first, grid=uniform(10))
    assert prepared(problem=again).duration == pytest.approx(solve(again, grid=uniform(10)).duration, rel=1e-7)
