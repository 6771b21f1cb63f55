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


@pytest.mark.slow
@pytest.mark.parametrize("speeds", [[2.0, FREE, FREE, FREE], [FREE, FREE, 4.0, FREE], [FREE, FREE, FREE, 0.6]], ids=str)
def test_speeds_of_joints_are_states_in_one_form_and_expressions_in_the_other(speeds):
    found = [
        polish(solve(motion(form, speeds), grid=uniform(100), solver=QUIET), seconds=100.0)
        for form in (canonical, lagrange)
    ]
    assert all(solution.structure is not None for solution in found), [solution.message for solution in found]
    # Drives with slack are free to take different ways: what they leave open is what both say of their conditions.
    assert found[0].duration == pytest.approx(found[1].duration, rel=3e-6)
    kinds = [[arc.kinds for arc in solution.structure.arcs] for solution in found]
    if kinds[0] == kinds[1] and not any(Kind.INTERIOR in kind for kind in kinds[0]):
        assert found[0].duration == pytest.approx(found[1].duration, abs=1e-9)
        starts = [np.cumsum([arc.duration for arc in solution.structure.arcs]) for solution in found]
        np.testing.assert_allclose(starts[0], starts[1], atol=1e-6)
    reports = [verify(solution) for solution in found]
    assert all(report.ok for report in reports), [report.failures for report in reports]
