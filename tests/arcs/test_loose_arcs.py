"""Loose arcs: what is not known of a structure stays free, and becomes exact where the motion says so."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from catalogue import problems

from models import robots
from models.effects import Coulomb, Gravity, Payload, Viscous
from models.forms import canonical
from models.scenes.scene_template import TASKS
from ocp import Ball, Control, Ipopt, legendre, outside, point_to_point, polish, solve, uniform, verify
from ocp.arcs.arc_nlp import prepare_arcs
from ocp.arcs.arc_problems import arc_problem
from ocp.arcs.arcs import durations, elements_of, refined
from ocp.arcs.limit_arcs import Cells, LimitArc, in_succession
from ocp.arcs.loose_arcs import freed, read_loosely, with_active_limits
from ocp.arcs.moving_grid import move_grid
from ocp.arcs.optimality_check import Crossing, WrongSign
from ocp.solution.structure import Arc, Contact, Kind
from ocp.solving.guess_conversion import from_solution

LOWER, UPPER, INTERIOR, HOLDING = Kind.LOWER, Kind.UPPER, Kind.INTERIOR, Kind.HOLDING
QUIET = Ipopt(progress=False)
LIFT = problems.lift_fastest(speed=1.2)  # full force, the speed limit, full braking


def lift(arcs=None, **settings):
    """Return the task, its motion on a moved grid, the NLP of the arcs read from it or of given ones, and the guess."""
    coarse = solve(LIFT.problem, grid=uniform(20), solver=QUIET)
    moved = move_grid(coarse, LIFT.problem, legendre(4, Control.SEGMENTS))
    task = arc_problem(LIFT.problem, legendre(4, Control.SEGMENTS), coarse.values)
    arcs = read_loosely(LIFT.problem, moved) if arcs is None else arcs
    guess = from_solution(moved)
    return task, moved, prepare_arcs(task, arcs, elements_of(arcs), guess, QUIET, **settings), guess


def test_controls_at_the_wrong_bound_become_free_there():
    arcs = Arc((LOWER, UPPER), 1.0), Arc((UPPER, UPPER), 1.0)
    wrong = WrongSign(1, 0.5, 1.25, 1e-3, LOWER)
    kinds = [(arc.kinds, arc.duration) for arc in freed(arcs, (wrong,))]
    assert kinds == [((LOWER, UPPER), 0.5), ((LOWER, INTERIOR), 0.5), ((UPPER, INTERIOR), 0.25), ((UPPER, UPPER), 0.75)]
    assert freed(arcs, ()) == arcs


def test_elements_are_more_where_the_density_asks_for_more():
    arcs = Arc((LOWER,), 1.0), Arc((UPPER,), 3.0)
    even = np.array([0.0, 1.0]), np.zeros(1)
    assert refined(arcs, even) == elements_of(arcs) == (4, 12)
    # 40 elements per motion on the first quarter of it, none asked for on the rest
    assert refined(arcs, (np.array([0.0, 0.25, 1.0]), np.array([40.0, 0.0]))) == (10, 12)


def test_limits_that_seem_to_be_reached_at_once_are_reached_one_after_the_other():
    edges = np.linspace(0.0, 1.0, 11)
    inside = np.zeros((10, 2), dtype=bool)
    inside[5:, 0], inside[4:, 1] = True, True  # the second control leaves its bound first
    cells = Cells(edges, np.where(inside, 0.5, 0.0), 1e-3, True)
    holds = [LimitArc(Contact(0, 1, 0), 0.5, 0.9), LimitArc(Contact(1, 1, 1), 0.5, 0.9)]
    first, second = in_succession(cells, holds)
    assert (first.contact.limit, first.start) == (1, 0.5)
    assert second.contact.limit == 0
    assert 0.5 < second.start < 0.6
    apart = [holds[0], replace(holds[1], start=0.7)]
    assert [hold.start for hold in in_succession(cells, apart)] == [0.5, 0.7]


def test_reading_pins_what_stays_at_a_bound_and_frees_the_rest():
    task, moved, nlp, guess = lift()
    arcs = read_loosely(task.problem, moved)
    kinds = [arc.kinds[0] for arc in arcs]
    assert kinds[0] is UPPER
    assert kinds[-1] is LOWER
    assert INTERIOR in kinds
    assert sum(arc.duration for arc in arcs) == pytest.approx(moved.duration)
    motion = nlp.solve(nlp.start(guess, durations(arcs)))
    named = with_active_limits(task, motion)
    assert [(c.limit, c.side, c.control) for c in named[kinds.index(INTERIOR)].held] == [(0, 1, -1)]


def test_widths_tied_within_arcs_are_those_of_the_arcs():
    task, _, nlp, guess = lift()
    arcs, shares = nlp.arcs, np.concatenate([[0.25, 0.75], np.ones(len(nlp.arcs) - 1)])
    counts = (2, *[1] * (len(arcs) - 1))
    found = []
    for tied in (False, True):
        other = prepare_arcs(task, arcs, counts, guess, QUIET, shares=shares, tied=tied)
        motion = other.solve(other.start(guess, durations(arcs)))
        first = motion.grid.widths[:2] * motion.duration
        assert first / first.sum() == pytest.approx([0.25, 0.75], abs=1e-9)
        found.append(durations(motion.arcs))
    np.testing.assert_allclose(found[0], found[1], atol=1e-8)
    np.testing.assert_array_equal(
        len(prepare_arcs(task, arcs, counts, guess, QUIET, shares=shares, tied=True).owner), sum(counts)
    )


def test_limits_are_drawn_in_where_they_are_exceeded():
    _, _, nlp, guess = lift()
    speed = nlp.task.limits[0]
    drawn = replace(nlp, drawn_in=(Crossing(Contact(0, 1), 0.0, 10.0, 0.0, 0.1),))
    for one, share in ((nlp, 0.0), (drawn, 0.1)):
        motion = one.solve(one.start(guess, durations(one.arcs)))
        assert np.max(motion.states[:, :, 1]) == pytest.approx(speed.upper - share * speed.range, abs=1e-7)


def test_durations_keep_their_shares_of_the_guessed_ones():
    wrong = Arc((UPPER,), 0.5), Arc((HOLDING,), 1.0, (Contact(0, 1, 0),)), Arc((LOWER,), 0.1)
    _, _, nlp, guess = lift(wrong, spread=(0.4, 1.8))
    low, high = (side[nlp.nlp.layout.horizon] * nlp.nlp.scaling.horizon for side in nlp.sides()[:2])
    np.testing.assert_allclose(low, [0.2, 0.4, 0.04])
    np.testing.assert_allclose(high, [0.9, 1.8, 0.18])
    motion = nlp.solve(nlp.start(guess, np.array([arc.duration for arc in wrong])))
    ratios = np.array([arc.duration for arc in motion.arcs]) / [0.5, 1.0, 0.1]
    assert np.all((ratios > 0.4 - 1e-6) & (ratios < 1.8 + 1e-6))


def motion(machine, q0, q1, payload, limit, speed=None, friction=False):
    default, limit = TASKS[machine], np.array(limit)
    effects = [Gravity(), Payload(payload)]
    effects += [Viscous(tuple(0.01 * limit)), Coulomb(tuple(0.03 * limit), 0.3)] if friction else []
    limits = {"q": (default.q_min, default.q_max), "tau": limit} | ({} if speed is None else {"v": speed})
    return point_to_point(canonical(default.machine(), effects), q0, q1, **limits)


ORDINARY = {
    # Two joints reach their speed limits within 1 ms of each other, three hold them together.
    "two limits almost at once": (
        ("spherical", (1.6962, -2.1143, -1.4034, 1.0655), (2.6462, -2.3413, -0.7784, 0.9689), 3.252,
         (471.69, 179.32, 2.16, 732.37), (4.034, 3.318, 1.858, 1.641)), 0.403426),
    "short arcs and touches, one drive slack": (
        ("cylindrical", (0.8536, 1.1668, 0.6944), (-2.4584, 0.7573, 0.5796), 4.923, (290.89, 1751.31, 501.07)),
        0.773250),
    "friction and a touch": (
        ("torus", (0.9923, 0.0248, -0.9549), (-2.7378, 1.1425, 2.4008), 2.688, (251.75, 1152.83, 351.6), None, True),
        0.538298),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_tasks_are_polished(name):
    numbers, expected = ORDINARY[name]
    coarse = solve(motion(*numbers), grid=uniform(50), solver=QUIET)
    result = polish(coarse, seconds=100.0)
    assert result.structure is not None, result.message
    assert result.duration == pytest.approx(expected, abs=3e-6)  # constant controls on 75 moved elements: within 1e-5
    assert result.duration < coarse.duration
    report = verify(result)
    assert report.violation < 1e-6, report


def from_rest_to_rest(machine, begin, finish):
    limits = {name: sides for name, sides in machine.limits.items() if name != "v"}
    return point_to_point(canonical(machine, [Gravity()]), begin, finish, limits=limits)


@pytest.mark.slow
def test_a_motion_that_is_no_local_optimum_leads_to_a_better_one():
    problem = from_rest_to_rest(robots.ur5(), [0.0, -1.0, 1.0, 0.0, 0.5, 0.0], [1.0, -0.5, 0.5, 0.5, 0.0, 0.5])
    coarse = solve(problem, grid=uniform(50), solver=QUIET)
    result = polish(coarse, seconds=100.0)
    # A grid of 50 elements has 0.21540 s, and 0.21194 s from the guess that polish solves again from.
    assert result.structure is not None, result.message
    assert result.duration == pytest.approx(0.211888, abs=2e-6)
    assert "no local optimum" in result.message
    assert verify(result).ok


@pytest.mark.slow
def test_the_tool_of_an_arm_passes_an_obstacle():
    machine = robots.manutec_r3()
    arm = canonical(machine, [Gravity()])
    problem = point_to_point(arm, [0.0, -1.5, 0.0], [1.0, -1.95, 1.0], limits=machine.limits)
    tool = ca.Function("tool", [machine.q], [machine.tool])
    begin, middle, finish = (tool(q).full().ravel() for q in ([0, -1.5, 0], [0.5, -1.725, 0.5], [1, -1.95, 1]))
    ball = Ball(tuple(middle.tolist()), 0.25 * float(np.linalg.norm(finish - begin)))
    problem = replace(problem, subject_to=(*problem.subject_to, outside(ball, arm["tool"])))
    coarse = solve(problem, grid=uniform(50), solver=QUIET)
    result = polish(coarse, seconds=100.0)
    assert result.structure is not None, result.message
    assert result.duration == pytest.approx(0.5036425, abs=5e-7)
    t = np.linspace(0.0, float(result.duration), 2000)
    away = np.linalg.norm(result.signal("tool", t) - middle, axis=1) / ball.radius
    assert np.min(away) > 1.0 - 1e-6
