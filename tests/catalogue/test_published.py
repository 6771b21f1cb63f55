"""Published problems: values of default solves within their estimates, refined values to many digits."""

import numpy as np
import pytest
from catalogue.published import PUBLISHED

from ocp import Share, estimate, solve, solve_to_accuracy, verify

# Cheap ones of every kind: defaults and their estimate; the true error may not be above it, nor far below.
DEFAULT = (
    "double integrator from (1, 1)", "van der Pol in least time", "linear tangent steering", "past two discs",
    "great circle", "soap film", "geodesic of the half plane", "hanging chain", "Dido", "Hager",
    "linear boundary layers", "Kirk 5.1-1", "Duffing oscillator", "van der Pol with a state limit", "catalyst mixing",
    "fishing", "singular regulator", "moon lander", "Goddard rocket", "orbit raising", "flying robot", "batch reactor",
    "cart-pole",
)  # fmt: skip


def test_there_are_forty():
    assert len(PUBLISHED) >= 40
    assert all(one.source for one in PUBLISHED.values())


@pytest.mark.parametrize("name", DEFAULT)
def test_the_estimate_of_a_default_solve_contains_the_true_error(name):
    known = PUBLISHED[name]
    solution = solve(known.make())
    assert solution.ok
    true, estimated = abs(solution.cost - known.nearest(solution.cost)), estimate(solution).cost
    assert true <= 3.0 * estimated + 2.0 * known.digits
    assert estimated <= 1000.0 * true + 1e-6 * abs(known.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["brachistochrone", "Zermelo", "Rayleigh in least time", "past two discs"])
def test_refined_to_the_published_digits(name):
    known = PUBLISHED[name]
    last = list(solve_to_accuracy(known.make(), Share(1e-7), seconds=60.0))[-1]
    assert last.ok
    assert last.cost == pytest.approx(known.value, rel=1e-6, abs=2.0 * known.digits)
    assert abs(last.cost - known.value) <= 3.0 * last.accuracy.errors.cost + 2.0 * known.digits


def test_dependent_limits_at_a_fixed_end_do_not_spoil_the_estimate():
    # v >= 0, h >= 1 and m >= 0.6 along, with m(T) = 0.6 and v(T) = 0: 3.7e4 was estimated.
    with_limits, without = (
        solve(PUBLISHED[name].make()) for name in ("Goddard rocket", "Goddard, no redundant limits")
    )
    assert with_limits.cost == pytest.approx(without.cost, rel=1e-7)
    assert estimate(with_limits).cost < 10.0 * estimate(without).cost
    assert verify(with_limits).ok
    assert np.isfinite(estimate(with_limits).cost)
