"""Designs of experiments and the tree of neighbours over their cases."""

import importlib.util

import numpy as np
import pytest

from ocp.studies.designs import LatinHypercube, Listed, Product, Random, Sobol, Zip
from ocp.studies.warm_start_tree import neighbours, parents

BOX = {"a": (0.0, 1.0), "b": (-2.0, 2.0)}
needs_scipy = pytest.mark.skipif(importlib.util.find_spec("scipy") is None, reason="SciPy is not installed")


def test_product_zip_and_list():
    assert Product({"a": [1, 2], "b": ["x", "y"]}).cases() == [
        {"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 2, "b": "x"}, {"a": 2, "b": "y"}
    ]  # fmt: skip
    assert Zip({"a": [1, 2], "b": [3, 4]}).cases() == [{"a": 1, "b": 3}, {"a": 2, "b": 4}]
    assert Listed([{"a": 1, "b": 2}, {"b": 4, "a": 3}]).cases() == [{"a": 1, "b": 2}, {"a": 3, "b": 4}]
    values = Product({"a": np.linspace(0.0, 1.0, 3), "limits": np.eye(2)}).cases()
    assert values[1] == {"a": 0.0, "limits": (0.0, 1.0)}
    assert all(type(case["a"]) is float for case in values)


@pytest.mark.parametrize("design", [Random, pytest.param(LatinHypercube, marks=needs_scipy),
                                    pytest.param(Sobol, marks=needs_scipy)])  # fmt: skip
def test_samples_fill_the_box_and_follow_the_seed(design):
    points = np.array([list(case.values()) for case in design(BOX, 64, seed=3).cases()])
    assert points.shape == (64, 2)
    assert np.all(points >= [0.0, -2.0])
    assert np.all(points <= [1.0, 2.0])
    assert design(BOX, 64, seed=3).cases() == design(BOX, 64, seed=3).cases()
    assert design(BOX, 64, seed=3).cases() != design(BOX, 64, seed=4).cases()
    assert np.all(np.abs(points.mean(axis=0) - [0.5, 0.0]) < [0.15, 0.6])


@needs_scipy
def test_a_latin_hypercube_has_one_point_in_every_slice():
    points = np.array([list(case.values()) for case in LatinHypercube(BOX, 40, seed=1).cases()])
    for column, (low, high) in zip(points.T, BOX.values(), strict=True):
        assert sorted(np.floor((column - low) / (high - low) * 40).astype(int)) == list(range(40))


@needs_scipy
def test_sobol_points_are_balanced():
    points = np.array([list(case.values()) for case in Sobol({"a": (0.0, 1.0), "b": (0.0, 1.0)}, 64).cases()])
    counts = np.histogram2d(*points.T, bins=8, range=[[0, 1], [0, 1]])[0]
    assert np.all(counts == 1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Product({}), "at least one axis"),
        (lambda: Product({"a": []}), "'a'.*at least one value"),
        (lambda: Product({"a": "xyz"}), "'a'.*expected a list"),
        (lambda: Product({"a": [float("nan")]}), "'a'.*finite number"),
        (lambda: Product({"a": [None]}), "'a'.*None.*finite number"),
        (lambda: Zip({"a": [1], "b": [1, 2]}), "a 1, b 2"),
        (lambda: Listed([{"a": 1}, {"b": 1}]), "case 1 has b, the first one a"),
        (lambda: Listed([]), "at least one"),
        (lambda: Random({"a": (1.0, 0.0)}, 3), "'a'.*lower < upper"),
        (lambda: Random({"a": 1.0}, 3), "'a'.*expected \\(lower, upper\\)"),
        (lambda: Random(BOX, 0), "count is 0"),
        (lambda: Random(BOX, 2, seed=-1), "seed is -1"),
    ],
)
def test_wrong_designs_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_every_case_of_a_grid_starts_from_an_adjacent_one():
    shape = (7, 5)
    cases = Product({"a": np.geomspace(1.0, 100.0, shape[0]), "b": range(shape[1])}).cases()
    found = parents(cases)
    assert found.count(None) == 1
    for number, above in enumerate(found):
        if above is not None:
            steps = np.abs(np.subtract(np.unravel_index(number, shape), np.unravel_index(above, shape)))
            assert steps.sum() == 1
    # From every case the way leads to the root.
    for number in range(len(cases)):
        seen = set()
        while number is not None:
            assert number not in seen
            seen.add(number)
            number = found[number]


def test_texts_separate_trees():
    cases = Product({"form": ["canonical", "hamel"], "a": range(5)}).cases()
    found = parents(cases)
    assert found.count(None) == 2
    assert all(cases[k]["form"] == cases[above]["form"] for k, above in enumerate(found) if above is not None)


def test_many_cases_are_compared_block_by_block():
    cases = Random(BOX, 700, seed=2).cases()
    found = parents(cases)
    assert found.count(None) == 1
    assert found == parents(cases)
    assert parents([]) == []


def test_neighbours_differ_in_one_step():
    cases = Product({"a": [3.0, 1.0, 2.0], "b": [0, 1], "c": ["x", "y"]}).cases()
    pairs = neighbours(cases)
    assert len(pairs) == 2 * 2 * 2 + 3 * 2
    for one, other in pairs:
        assert sum(cases[one][name] != cases[other][name] for name in cases[0]) == 1
