"""Polished motions with limits of speed: the same whatever form the limit is stated in."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue import problems

from models import spherical
from models.effects import Gravity
from models.forms import canonical, lagrange
from ocp import Ipopt, along, point_to_point, polish, solve, uniform, verify
from ocp.solution.structure import Kind

QUIET = Ipopt(progress=False)
FREE = np.inf


@pytest.mark.parametrize("stated", [lambda v: 2.0 * v, lambda v: v + v**3], ids=["linear", "cubic"])
def test_a_limit_on_an_expression_is_held_as_one_on_a_state(stated):
    known = problems.lift_fastest(speed=1.2)
    first, last, speed, force = known.problem.subject_to
    own = along(stated(known.problem.system.x[1]), stated(speed.lower), stated(speed.upper))
    problem = replace(known.problem, subject_to=(first, last, own, force))
    solution = polish(solve(problem, grid=uniform(20), solver=QUIET))
    assert solution.structure is not None, solution.message
    assert solution.cost == pytest.approx(known.cost, abs=1e-11)
    assert solution.structure[-1].kind is Kind.LIMIT
    assert verify(solution).ok


def motion(form, speeds):
    arm = form(spherical(), [Gravity()])
    return point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=[260.0, 160.0, 3.0, 400.0], v=speeds,
                          q=([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]))  # fmt: skip


def polished_in_both(speeds):
    """Return the polished motions in canonical form, where speeds are expressions, and in Lagrange form, verified."""
    found = [
        polish(solve(motion(form, speeds), grid=uniform(100), solver=QUIET), seconds=100.0)
        for form in (canonical, lagrange)
    ]
    assert all(solution.structure is not None for solution in found), [solution.message for solution in found]
    reports = [verify(solution) for solution in found]
    assert all(report.ok for report in reports), [report.failures for report in reports]
    return found, reports


@pytest.mark.slow
@pytest.mark.parametrize("speeds", [[2.0, FREE, FREE, FREE], [FREE, FREE, FREE, 0.6]], ids=str)
def test_speeds_of_joints_are_states_in_one_form_and_expressions_in_the_other(speeds):
    found, reports = polished_in_both(speeds)
    assert found[0].duration == pytest.approx(found[1].duration, abs=1e-9)
    kinds = [[arc.kinds for arc in solution.structure.arcs] for solution in found]
    assert kinds[0] == kinds[1]
    starts = [np.cumsum([arc.duration for arc in solution.structure.arcs]) for solution in found]
    np.testing.assert_allclose(starts[0], starts[1], atol=1e-6)
    assert max(report.hamiltonian for report in reports) < 1e-5


@pytest.mark.slow
def test_drives_with_slack_take_another_way_in_each_form():
    # Only the duration is the same, up to what the sign conditions leave open; 0.681618014 s with another structure.
    found, reports = polished_in_both([FREE, FREE, 4.0, FREE])
    assert found[0].duration == pytest.approx(found[1].duration, rel=1e-6)
    assert max(solution.duration for solution in found) < 0.681618014
    assert max(report.violation for report in reports) < 1e-5
