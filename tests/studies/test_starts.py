"""Studies that look for other local optima: several starts wherever a case is solved cold."""

import numpy as np
import pytest
from catalogue.published import f8
from catalogue.studies import QUIET, carts

from ocp import Study


def aircraft(limit):
    assert limit > 0.0
    return f8()


def test_one_start_is_the_default_and_changes_no_identity():
    assert carts().identity == carts(starts=1).identity
    assert carts().identity != carts(starts=3).identity
    assert carts(starts=2).identity != carts(starts=3).identity


def test_cold_cases_are_solved_from_all_starts():
    few = {"mass": [1.0, 2.0], "limit": [1.0]}
    table = carts(starts=3, over=few).run()
    assert np.all(table.ok)
    np.testing.assert_allclose(table["duration"], carts(over=few).run()["duration"], rtol=1e-8)
    for way, message in zip(table["way"], table["message"], strict=True):
        assert ("from 3 starts" in message) == way.startswith("cold")


def test_wrong_numbers_of_starts_are_named():
    with pytest.raises(ValueError, match="Study: starts"):
        carts(starts=0)


@pytest.mark.slow
def test_another_optimum_is_found():
    one, many = (Study(aircraft, over={"limit": [1.0]}, solver=QUIET, starts=count).run() for count in (1, 12))
    assert one["cost"][0] == pytest.approx(5.7324, abs=1e-3)
    assert many["cost"][0] == pytest.approx(3.7828, abs=1e-3)  # 3.78086 to all digits
