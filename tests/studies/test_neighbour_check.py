"""Neighbours between which the cost jumps are solved from each other; failed cases are reached by continuation."""

from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from catalogue.studies import QUIET, cart, carts

from ocp import Bolza, Fixed, Problem, Study, System, along, start, uniform
from ocp.solution.solution import Status
from ocp.solution.storage import decode
from ocp.studies.case_solver import CaseSolver, OpenCase
from ocp.studies.main_effects import jump_pairs, jumps
from ocp.studies.neighbour_check import unchecked_jumps
from ocp.studies.warm_start_tree import between, nearest

X, U, TILT = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("tilt")
WELLS = System(X, U, TILT, U, {"x": X}, {"tilt": 0.0})
TILTS = [round(-1.95 + 0.2 * k, 9) for k in range(21)]


def well():
    """x' = u from 0 in a second, at the least final (x^2 - 1)^2 + tilt x and 0.01 of the integral of u^2."""
    return Problem(
        WELLS, horizon=Fixed(1.0), minimise=Bolza(running=0.01 * U**2, final=(X**2 - 1.0) ** 2 + TILT * X),
        subject_to=(start(X, 0.0), along(U, -10.0, 10.0)),
    )  # fmt: skip


def lowest(tilt):
    """The end x is reached with constant u, so that the cost is a polynomial of x."""
    x = np.linspace(-2.0, 2.0, 400001)
    return np.min((x**2 - 1.0) ** 2 + tilt * x + 0.01 * x**2)


def wells(**changes):
    return Study(well(), **{**dict(over={"tilt": TILTS}, grid=uniform(4), solver=QUIET, checked=0.0), **changes})


def test_the_better_well_spreads_from_neighbour_to_neighbour():
    """Warm starts stay in the well of the first case until it vanishes; there the cost jumps."""
    table = wells().run()
    np.testing.assert_allclose(table["cost"], [lowest(tilt) for tilt in TILTS], atol=1e-6)
    assert any(way.startswith("warm, better than") for way in table["way"])
    assert list(unchecked_jumps(table.cases, table.records)) == []


def test_a_single_case_at_a_saddle_is_found_between_its_neighbours():
    """Without tilt, x = 0 is stationary and the first guess; its neighbours lie in the wells."""
    table = wells(over={"tilt": [0.2 * k for k in range(-5, 6)]}).run()
    np.testing.assert_allclose(table["cost"][5], lowest(0.0), atol=1e-6)
    assert table["way"][5] == "warm, better than cold"


def test_a_smooth_ridge_is_no_jump():
    cases = [{"a": 0.1 * k} for k in range(-10, 11)]
    assert jump_pairs(cases, [-(case["a"] ** 2) for case in cases]) == ()
    assert jump_pairs(cases, [-abs(case["a"]) for case in cases]) == ()
    assert {(9, 10), (10, 11)} <= set(jump_pairs(cases, [float(k == 10) for k in range(21)]))


def test_compared_neighbours_are_not_compared_again(tmp_path, monkeypatch):
    study = wells(store=tmp_path / "s.db")
    first = study.run()
    monkeypatch.setattr(CaseSolver, "solve", lambda *_: pytest.fail("a case was computed again"))
    second = study.run()
    rows = [(r.id, r.way, r.attempts, r.finished, dict(r.results), dict(r.timings)) for r in first.records]
    assert rows == [(r.id, r.way, r.attempts, r.finished, dict(r.results), dict(r.timings)) for r in second.records]
    assert second.solution(0).cost == second["cost"][0]


def test_one_optimum_everywhere_raises_no_alarm():
    """A step of the cost with one optimum on both sides: the neighbours are compared, and nothing changes."""
    table = Study(stepped, over={"mass": [1.0 + 0.1 * k for k in range(10)]}, grid=uniform(10), solver=QUIET).run()
    assert jumps(table)
    assert list(unchecked_jumps(table.cases, table.records)) == []
    assert not any("better" in way for way in table["way"])


def stepped(mass):
    return cart(limit=1.0 if mass < 1.45 else 2.0, distance=mass)


def test_without_neighbours_a_jump_is_left_open():
    table = Study(stepped, over={"mass": [1.0 + 0.1 * k for k in range(10)]}, grid=uniform(10), solver=QUIET,
                  neighbours=False).run()  # fmt: skip
    assert (4, 5) in unchecked_jumps(table.cases, table.records)


def test_the_path_between_two_cases_moves_floating_point_numbers_only():
    first, last = {"a": 1.0, "n": 3, "form": "x"}, {"a": 2.0, "n": 5, "form": "x"}
    assert between(first, last, 0.25) == {"a": 1.25, "n": 5, "form": "x"}
    assert between(first, last, 1.0) == last
    cases = [{"a": a, "form": form} for form in ("x", "y") for a in (1.0, 2.0, 10.0)]
    assert nearest(cases, 0, [2, 4]) == 2
    assert nearest(cases, 0, [4, 5]) is None


@pytest.mark.parametrize(("reach", "steps"), [(0.6, 2), (0.3, 4), (0.01, None)])
def test_a_case_that_no_direct_start_reaches_is_reached_in_halved_steps(reach, steps, monkeypatch):
    table = carts(over={"mass": [1.0]}).run()
    seen = [1.0]
    solver = CaseSolver(SimpleNamespace(function=cart))

    class Short:
        def proceed(self, near, values):
            ok = abs(values["mass"] - near.values["mass"]) <= reach
            if ok:
                seen.append(values["mass"])
            return replace(near, values=values) if ok else SimpleNamespace(ok=False)

    monkeypatch.setattr(CaseSolver, "_nlp", lambda *_: Short())
    content = table.read(table.records[0].id, "solution")
    solution = solver._continued({"mass": 2.0}, {"mass": 1.0}, lambda own: decode(content, own, "first"))
    assert (solution is None) == (steps is None)
    if steps:
        assert seen == [1.0 + k / steps for k in range(steps + 1)]


def test_a_single_case_is_reached_from_the_nominal_values_of_its_parameters(tmp_path, monkeypatch):
    """Cold starts succeed near the nominal mass of 1 only, and no step of the mass may be longer than 1."""
    study = carts(over={"mass": [3.0]}, store=tmp_path / "s.db")
    whole, build = carts(over={"mass": [3.0]}).run(), CaseSolver._nlp

    def guarded(self, problem, values):
        prepared, mass = build(self, problem, values), values["mass"]

        class Guarded:
            def __call__(self, ladder, values):
                found = prepared(ladder, values)
                return found if abs(mass - 1.0) < 0.1 else replace(found, status=Status.INFEASIBLE)

            def proceed(self, near, values):
                found = prepared.proceed(near, values)
                return found if abs(mass - near.values["mass"]) <= 1.0 else replace(found, status=Status.INFEASIBLE)

        return Guarded()

    monkeypatch.setattr(CaseSolver, "_nlp", guarded)
    assert list(study.run().failures) == [0]
    table = study.run(retry_failed=True)
    assert table.ok.all()
    assert table["way"][0] == "continued"
    np.testing.assert_allclose(table["duration"], whole["duration"], rtol=1e-8)


def test_a_failed_case_is_retried_from_its_nearest_solved_neighbour(tmp_path, monkeypatch):
    study, solve = carts(store=tmp_path / "s.db"), CaseSolver.solve
    number = 0

    def refuse(self, task, problem, values):
        if task.case == study.cases[number]:
            raise ArithmeticError("not now")
        return solve(self, task, problem, values)

    monkeypatch.setattr(CaseSolver, "solve", refuse)
    assert list(study.run().failures) == [number]
    tasks = []
    monkeypatch.setattr(CaseSolver, "solve", lambda self, task, *rest: tasks.append(task) or solve(self, task, *rest))
    assert study.run(retry_failed=True).ok.all()
    assert isinstance(tasks[0], OpenCase)
    assert tasks[0].thorough
    assert sum(tasks[0].case[name] != tasks[0].neighbour.case[name] for name in tasks[0].case) == 1
