"""A solution file that release 0.1.0 wrote: a polished motion of a cylindrical manipulator on a grid of 20 elements."""

from pathlib import Path

import numpy as np
from catalogue.released import shortest

from ocp import Status, legendre, load, verify

FILE = Path(__file__).parent / "data" / "released.npz"
DURATION = float.fromhex("0x1.199d4c5aabc2ap-1")  # as that release printed it


def test_a_released_solution_file_is_read_bit_by_bit():
    solution = load(FILE)
    assert solution.status is Status.SOLVED
    assert solution.duration == solution.cost == DURATION
    assert solution.scheme.name == "legendre"  # of the arcs
    np.testing.assert_array_equal(solution.scheme.points, legendre(len(solution.scheme.points)).points)
    switches = np.cumsum([arc.duration for arc in solution.structure.arcs])
    np.testing.assert_allclose(switches, [0.1264198297, 0.2750141077, 0.3608486695, 0.5500282155], atol=5e-11)
    kinds = ["".join(kind.value[0] for kind in arc.kinds) for arc in solution.structure.arcs]
    assert kinds == ["uil", "uiu", "liu", "lil"]  # upper, interior, lower
    assert solution.x(0.0).shape == (6,)


def test_a_released_solution_still_passes_verification():
    report = verify(load(FILE, shortest(1.0)))
    assert report.ok, report
