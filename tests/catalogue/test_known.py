"""Problems with a known optimum are solved to it, verified, with their switching times in place."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from catalogue import problems

from models.forms import canonical, hamel, lagrange
from ocp import Control, Ipopt, Status, legendre, radau, smooth, solve, uniform, verify

SMOOTH = radau(3, Control.COLLOCATED)
FORMS = {"lagrange": lagrange, "hamel": hamel, "canonical": canonical}
EXACT = {
    "bryson_denham_boundary_arc": lambda: problems.bryson_denham(0.1),
    "bryson_denham_touch": lambda: problems.bryson_denham(0.2),
    "bryson_denham_free": lambda: problems.bryson_denham(0.3),
    "brachistochrone": problems.brachistochrone,
    "lift_fixed_duration": lambda: problems.lift_cheapest(0.8),
    "lift_free_duration": problems.lift_cheapest,
    "lift_compromise": problems.lift_compromise,
}
FASTEST = {
    "double_integrator": problems.double_integrator_2d,
    "lift_up": problems.lift_fastest,
    "lift_down": lambda: problems.lift_fastest(up=False),
    "lift_up_slow": lambda: problems.lift_fastest(speed=1.2),
    "lift_down_slow": lambda: problems.lift_fastest(up=False, speed=1.2),
    "lift_weightless": lambda: problems.lift_fastest(g=0.0),
}


def solved(known, scheme=None, elements=40):
    solution = solve(known.problem, scheme=scheme, grid=uniform(elements), guess=known.guess)
    assert solution.status is Status.SOLVED, f"{known.name}: {solution.message}"
    return solution


def assert_verified(solution, fastest=False):
    report = verify(solution)
    assert report.drift < 1e-6, report
    if fastest:
        assert report.hamiltonian_value == pytest.approx(-1.0, abs=1e-3)


def changes_of_sign(solution, i):
    """Return the times at which the polygon through the middles of the elements crosses zero."""
    middles = solution.duration * (solution.grid.ends[:-1] + solution.grid.ends[1:]) / 2
    values = solution.u(middles)[:, i]
    before = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
    share = values[before] / (values[before] - values[before + 1])
    return middles[before] + share * (middles[before + 1] - middles[before])


def assert_switches(solution, known):
    element = solution.duration / len(solution.grid)
    for i, expected in enumerate(known.switches):
        result = changes_of_sign(solution, i)
        assert len(result) == len(expected), f"{known.name}: control {i} changes sign at {result}, expected {expected}"
        np.testing.assert_allclose(result, expected, rtol=0, atol=element, err_msg=f"{known.name}: control {i}")


@pytest.mark.parametrize("name", EXACT)
def test_smooth_optimum(name):
    known = EXACT[name]()
    solution = solved(known, SMOOTH)
    assert solution.cost == pytest.approx(known.cost, rel=1e-7)
    assert_verified(solution, fastest=name == "brachistochrone")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("machine", problems.MASSLESS)
def test_straight_line_of_least_effort(machine, form):
    known = problems.straight_line(machine, form=FORMS[form])
    solution = solved(known, SMOOTH)
    assert solution.cost == pytest.approx(known.cost, rel=1e-7)
    assert_verified(solution)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("machine", problems.MASSLESS)
def test_smooth_guess_leads_to_the_same_optimum(machine, form):
    known = problems.straight_line(machine, form=FORMS[form])
    solution = solved(replace(known, guess=smooth(known.problem, [])), SMOOTH)
    assert solution.cost == pytest.approx(known.cost, rel=1e-7)


@pytest.mark.parametrize("machine", problems.MASSLESS)
def test_straight_line_of_least_effort_is_straight(machine):
    solution = solved(problems.straight_line(machine), SMOOTH)
    s = np.linspace(0.0, 1.0, 50)
    tool = solution.signal("tool", s * solution.duration)
    expected = tool[0] + (3 * s**2 - 2 * s**3)[:, None] * (tool[-1] - tool[0])
    np.testing.assert_allclose(tool, expected, atol=1e-7)


@pytest.mark.parametrize("machine", problems.MASSLESS)
def test_straight_line_in_least_time(machine):
    known = problems.straight_line(machine, fastest=True)
    solution = solved(known, SMOOTH)
    assert solution.duration == pytest.approx(known.cost, rel=2e-4)
    assert_verified(solution, fastest=True)


@pytest.mark.parametrize("machine", problems.MASSLESS)
def test_straight_line_in_least_time_to_nine_digits(machine):
    # The only switch lies half way, on a node; what is left is the tolerance of the solver.
    known = problems.straight_line(machine, fastest=True)
    scheme = legendre(4, control=Control.COLLOCATED)
    solution = solve(known.problem, scheme, uniform(40), Ipopt(tol=1e-12), guess=known.guess)
    assert solution.ok
    assert solution.duration == pytest.approx(known.cost, abs=1e-9)


def test_least_effort_has_the_free_duration_of_the_closed_solution():
    solution = solved(problems.lift_cheapest(), SMOOTH)
    assert solution.duration == pytest.approx(np.sqrt(6 * 0.8 / 9.81), rel=1e-6)
    assert solution.cost == pytest.approx(807.8028402149, rel=1e-9)


def test_compromise_has_the_free_duration_of_the_closed_solution():
    known = problems.lift_compromise()
    assert solved(known, SMOOTH).duration == pytest.approx(0.75 * known.cost, rel=1e-6)


@pytest.mark.parametrize("name", FASTEST)
def test_bang_bang_optimum(name):
    known = FASTEST[name]()
    solution = solved(known, SMOOTH)
    assert solution.duration == pytest.approx(known.cost, rel=2e-4)
    assert solution.cost == solution.duration
    assert_verified(solution, fastest=True)
    assert_switches(solution, known)


@pytest.mark.parametrize("elements", [9, 40])
def test_constant_control_finds_the_optimum_of_its_grid(elements):
    # One element mixes both accelerations. Speed zero at the end gives the mixture, the distance the width.
    known = problems.lift_fastest()
    up, down = 60.0 / 3.0 - 9.81, -60.0 / 3.0 - 9.81
    lifting = int(elements * down / (down - up))
    a = np.full(elements, down)
    a[:lifting] = up
    a[lifting] -= np.sum(a)
    width = np.sqrt(0.8 / (a @ (elements - 0.5 - np.arange(elements))))
    solution = solved(known, elements=elements)
    assert solution.duration == pytest.approx(elements * width, rel=1e-8)
    assert solution.duration > known.cost
    np.testing.assert_allclose(solution.controls[:, 0, 0], 3.0 * (a + 9.81), rtol=0, atol=1e-4)
    assert_verified(solution, fastest=True)
    assert_switches(solution, known)


def test_lift_has_the_times_of_the_derivation():
    assert problems.lift_fastest().cost == pytest.approx(0.4590097461, abs=5e-11)
    assert problems.lift_fastest().switches[0][0] == pytest.approx(0.3420770133, abs=5e-11)
    assert problems.lift_fastest(speed=1.2).cost == pytest.approx(0.7456753968, abs=5e-11)


@cache
def cops_solution():
    return solved(problems.cops(), elements=100)


def test_cops_robot_arm():
    known, solution = problems.cops(), cops_solution()
    assert solution.duration == pytest.approx(known.cost, abs=5e-4)
    assert_verified(solution, fastest=True)
    assert_switches(solution, known)


def test_cops_robot_arm_comes_from_above():
    # A control that keeps its limits everywhere is slower than the optimum on any grid.
    assert cops_solution().duration > problems.cops().cost


def test_cops_robot_arm_is_no_mechanics():
    problem = problems.cops_with_inertial_terms()
    solution = solve(problem, grid=uniform(50))
    assert solution.ok
    assert_verified(solution, fastest=True)
    assert abs(solution.duration - problems.cops().cost) > 0.1


def test_two_link_arm():
    known = problems.two_link()
    solution = solved(known)
    assert solution.duration == pytest.approx(known.cost, abs=2e-3)
    assert_verified(solution, fastest=True)
    assert_switches(solution, known)


def test_two_link_arm_converges_with_the_grid():
    known = problems.two_link()
    coarse, fine = (abs(solved(known, elements=n).duration - known.cost) for n in (40, 160))
    assert fine < coarse / 8
    assert fine < 1e-4


def test_misprinted_two_link_arm_is_another_one():
    known = problems.two_link(misprinted=True)
    solution = solved(known, elements=100)
    assert solution.duration == pytest.approx(known.cost, abs=5e-4)
    assert abs(known.cost - problems.two_link().cost) > 0.03


@pytest.mark.parametrize("make", [problems.crane, problems.cart_pole], ids=lambda make: make.__name__)
@pytest.mark.parametrize(
    "scheme", [radau(5, Control.COLLOCATED), legendre(5, Control.COLLOCATED)], ids=lambda s: s.name
)
def test_published_to_its_digits(make, scheme):
    known = make()
    solution = solved(known, scheme)
    last = 10.0 ** -len(str(known.cost).partition(".")[2])  # the last published digit is rounded
    assert solution.cost == pytest.approx(known.cost, rel=1e-6, abs=0.51 * last)
    assert_verified(solution)
