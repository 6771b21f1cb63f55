"""Parameter studies: known results, any executor, nothing lost, nothing computed twice."""

import math
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from catalogue.studies import CART, QUIET, cart, carts, plain, squares

from ocp import Ipopt, Problem, Study, System, Zip, along, end, solve, start, uniform
from ocp.studies.store import Store, StoreError

ROOT = Path(__file__).parents[2]


def results(table):
    """Everything but how long it took."""
    return [(r.id, r.status, r.way, r.origin, dict(r.results)) if r else None for r in table.records]


def shortest(table):
    return 2.0 * np.sqrt(table["mass"] / table["limit"])


def test_a_study_of_parameters_and_limits_finds_the_known_durations():
    table = carts().run()
    assert np.all(table.ok)
    np.testing.assert_allclose(table["duration"], shortest(table), rtol=1e-8)
    np.testing.assert_allclose(table["peak u"], table["limit"], rtol=1e-6)
    np.testing.assert_allclose(table.grid("duration")[1], 2.0 / np.sqrt([0.5, 1.0, 2.0]), rtol=1e-8)
    ways = set(table["way"])
    assert "cold" in ways
    assert ways & {"warm", "warm, checked"}
    # Cold are the root of the tree and the cases with narrower limits than the neighbour that they start from.
    limits = {result.id: result.parameters["limit"] for result in table.records}
    for result in table.records:
        narrower = result.origin is None or limits[result.id] < limits[result.origin]
        assert result.way.startswith("cold") == narrower
    assert table.solution(0).duration == table["duration"][0]
    assert table.solution(0, cart(0.5)).signal("q", 0.0) == pytest.approx(0.0, abs=1e-9)


def test_neighbours_or_not_the_optimum_is_the_same():
    warm, cold = carts(checked=1.0).run(), carts(neighbours=False).run()
    np.testing.assert_allclose(warm["duration"], cold["duration"], rtol=1e-8)
    assert set(cold["way"]) == {"cold"}
    assert all("checked" in way or way == "cold" for way in warm["way"])


def test_a_problem_takes_values_of_its_parameters():
    table = Study(cart(), over={"mass": [1.0, 4.0]}, grid=uniform(10), solver=QUIET).run()
    np.testing.assert_allclose(table["duration"], [2.0, 4.0], rtol=1e-8)


def solved(mass):
    return solve(cart(), grid=uniform(10), solver=QUIET, values={"mass": mass})


def test_a_function_may_solve_by_itself():
    table = Study(solved, over={"mass": [1.0, 4.0]}).run()
    np.testing.assert_allclose(table["duration"], [2.0, 4.0], rtol=1e-8)
    assert set(table["way"]) == {"function"}
    assert table.solution(1).duration == table["duration"][1]


def test_a_case_asks_for_the_solution_of_its_nearest_neighbour_only(monkeypatch):
    asked = []
    monkeypatch.setattr(Store, "solution", lambda self, case, name="solution": asked.append(case))
    assert np.all(Study(plain, over={"a": range(60)}).run().ok)
    assert len(asked) == 59


def test_what_is_stored_is_not_computed_again(tmp_path):
    study = squares(tmp_path, 15)
    first = study.run()
    marks = (tmp_path / "marks").read_text()
    assert results(study.run()) == results(first) == results(study.table())
    assert (tmp_path / "marks").read_text() == marks
    longer = squares(tmp_path, 18).run()
    assert len(longer) == 18
    assert (tmp_path / "marks").read_text().split() == [*marks.split(), "15", "16", "17"]


def test_a_store_that_cannot_be_written_is_no_failure_of_a_case(tmp_path, monkeypatch):
    study, finish, full = carts(store=tmp_path / "s.db"), Store.finish, [True]

    def limited(self, study, result):
        # Room enough for a short result of a failure, but not for a solution.
        if full[0] and result.solutions and len(self.records(self.of_study(study))) >= 5:
            raise StoreError(f"{self.path}: cannot be written: database or disk is full")
        finish(self, study, result)

    monkeypatch.setattr(Store, "finish", limited)
    with pytest.raises(StoreError, match="disk is full"):
        study.run()
    assert sum(result is not None for result in study.table().records) == 5
    assert not study.table().failures
    full[0] = False
    assert results(study.run()) == results(carts().run())


def test_other_settings_never_mix(tmp_path):
    given = dict(store=tmp_path / "s.db")
    one = carts(**given).run()
    other = carts(**given, grid=uniform(12)).run()
    assert not {r.id for r in one.records} & {r.id for r in other.records}
    assert len(Store(tmp_path / "s.db", write=False).studies()) == 2
    assert carts().identity == carts().identity
    changed = [dict(settings={"a": 1}), dict(neighbours=False), dict(polished=True), dict(checked=0.2)]
    assert len({carts(**c).identity for c in (*changed, {})}) == 5


def test_a_failed_case_is_stored_and_tried_again_when_asked(tmp_path):
    study = squares(tmp_path, 15)
    table = study.run()
    assert list(table.failures) == [13]
    assert "ArithmeticError: 13 is unlucky (studies.py, line" in table.failures[13]
    assert math.isnan(table["square"][13])
    assert "1 failed" in str(table)
    assert study.run().records[13].attempts == 1
    assert study.run(retry_failed=True).records[13].attempts == 2
    assert (tmp_path / "marks").read_text().split().count("13") == 2
    assert (tmp_path / "marks").read_text().split().count("12") == 1


def test_an_infeasible_case_keeps_its_diagnosis_and_the_others_their_results():
    study = carts(over={"mass": [1.0, 2.0], "distance": [1.0, -1.0, 0.5], "limit": [1.0, 0.0]})
    table = study.run()
    bad = table["limit"] == 0.0
    assert np.array_equal(table.ok, ~bad)
    assert all(table["status"][bad] != "solved")
    assert all(len(message) > 20 for message in table["message"][bad])
    np.testing.assert_allclose(
        table["duration"][~bad], 2.0 * np.sqrt(table["mass"] * abs(table["distance"]))[~bad], rtol=1e-8
    )


def test_progress_is_told():
    seen = []
    carts().run(watch=seen.append)
    assert [p.done for p in seen] == list(range(13))
    assert seen[-1].total == 12
    assert seen[-1].failed == 0
    assert seen[-1].last.ok


def test_an_interrupt_keeps_what_is_stored(tmp_path):
    def stop(progress):
        if progress.done == 5:
            raise KeyboardInterrupt

    study = squares(tmp_path, 10)
    with pytest.raises(KeyboardInterrupt):
        study.run(watch=stop)
    assert np.sum(study.table().ok) == 5
    assert np.sum(study.run().ok) == 10


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Study(3, over={"a": [1]}), "expected one that can be called"),
        (lambda: Study(plain, over=3), "over is 3"),
        (lambda: Study(plain, over={}), "at least one axis"),
        (lambda: Study(plain, over={"a": [1]}, grid=50), "grid is 50"),
        (lambda: Study(plain, over={"a": [1]}, checked=2.0), "checked is 2.0"),
        (lambda: Study(plain, over={"a": [1]}, measure=1), "measure is 1"),
        (lambda: Study(plain, over={"a": [1]}).run("threads"), "executor is 'threads'"),
        (lambda: Study(plain, over={"a": [1]}).table(), "no store"),
    ],
)
def test_wrong_input_is_named(make, words):
    with pytest.raises((TypeError, ValueError), match=words):
        make()


def test_wrong_names_become_failures_that_name_them():
    assert "takes no c; it takes a, b" in Study(plain, over={"a": [1.0], "c": [1.0]}).run().failures[0]
    assert "no parameter 'm'" in Study(cart, over={"m": [1.0]}, solver=QUIET).run().failures[0]
    assert "expected a Problem" in Study(lambda a: "text", over={"a": [1]}).run().failures[0]


def test_names_with_dots_reach_arguments_with_underscores():
    table = Study(lambda payload_mass: payload_mass, over={"payload.mass": [1.0, 2.0]}).run()
    assert list(table["value"]) == [1.0, 2.0]


def test_problems_of_another_structure_get_a_programme_of_their_own():
    def either(fixed):
        problem = cart()
        return Problem(CART, subject_to=problem.subject_to[: 3 - fixed])

    table = Study(either, over={"fixed": [0, 1]}, grid=uniform(10), solver=QUIET).run()
    assert table.records[0].ok
    assert not table.records[1].ok  # nothing limits the control


@pytest.mark.parametrize("polished", [False, True])
def test_slopes_are_the_derivatives_of_the_known_durations(polished):
    table = carts(slopes=True, polished=polished, solver=Ipopt(tol=1e-12, progress=False)).run()
    np.testing.assert_allclose(table["duration"], shortest(table), rtol=1e-9)
    exact = {"mass": 0.5 * shortest(table) / table["mass"], "limit": -0.5 * shortest(table) / table["limit"]}
    for name, slope in exact.items():
        np.testing.assert_allclose(table[f"d duration / d {name}"], slope, rtol=1e-6)
        np.testing.assert_allclose(table[f"d cost / d {name}"], slope, rtol=1e-6)


def softer(inverse):
    return cart(limit=1.0 / inverse)


@pytest.mark.parametrize("inverse", [1e-9, 1e9])
def test_slopes_do_not_depend_on_the_size_of_a_number(inverse):
    solver = Ipopt(tol=1e-12, progress=False)
    table = Study(softer, over={"inverse": [inverse]}, grid=uniform(10), solver=solver, slopes=True).run()
    exact = np.sqrt(1.0 / inverse)  # T = 2 sqrt(inverse)
    np.testing.assert_allclose(table["d duration / d inverse"], exact, rtol=1e-5)


def test_zipped_axes():
    table = carts(over=Zip({"mass": [1.0, 4.0], "limit": [1.0, 4.0]})).run()
    np.testing.assert_allclose(table["duration"], 2.0, rtol=1e-8)
    with pytest.raises(ValueError, match="design is Zip"):
        table.grid("duration")


PAIR_X, PAIR_U = ca.SX.sym("x", 4), ca.SX.sym("u", 2)
PAIR = System(PAIR_X, PAIR_U, rate=ca.vertcat(PAIR_X[2:], PAIR_U), signals={"q": PAIR_X[:2], "v": PAIR_X[2:]})


def pair(short):
    """Two carts of one mass: the first has to go 1, the second, which has slack, only a short way."""
    return Problem(PAIR, subject_to=(
        start(PAIR_X, 0.0), end(PAIR_X, [1.0, short, 0.0, 0.0]), along(PAIR_U, -1.0, 1.0)))  # fmt: skip


def slack(solution):
    t = np.linspace(0.0, solution.duration, 2001)
    return {"duration": solution.duration, "rms": float(np.sqrt(np.mean(solution.u(t)[:, 1] ** 2)))}


def test_a_drive_with_slack_takes_the_least_effort():
    """The fastest motion takes T = 2; the least effort of the second cart is rms(u) = sqrt(12) short / T^2."""
    over = {"short": [0.1, 0.4]}
    plain_study, gentle = (
        Study(pair, over=over, grid=uniform(20), solver=QUIET, measure=slack, gentle=choice) for choice in (False, True)
    )
    assert plain_study.identity != gentle.identity
    table = gentle.run()
    np.testing.assert_allclose(table["duration"], 2.0, rtol=2e-4)
    np.testing.assert_allclose(table["rms"], np.sqrt(12.0) * np.array(over["short"]) / 4.0, rtol=5e-3)
    assert np.all(plain_study.run()["rms"] > table["rms"])
