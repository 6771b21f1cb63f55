import csv

import benchmark
import casadi as ca
import numpy as np
import pytest
from benchmarks import hand_written as reference
from benchmarks import peers
from benchmarks.problems import CASES, RunResult, numbers

from ocp import Ipopt, solve, uniform


@pytest.mark.parametrize("name", ["P3", "P4", "cylindrical"])
def test_hand_written_programs_pose_the_same_nlp(name):
    """All variants take the iterations of this project and end at its cost: only set-up and evaluation differ."""
    case, settings = CASES[name](), Ipopt(progress=False)
    given = numbers(case, 6, settings)
    own = solve(case.problem(), grid=uniform(6), solver=settings, guess=given.guess)
    assert own.ok
    for derive in benchmark.VARIANTS.values():
        result = reference.solve(derive, case, given, True)
        assert result.note == ""
        assert result.iterations == own.iterations
        assert result.cost == pytest.approx(own.cost, rel=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_gathered_derivatives_are_those_of_casadi(name):
    case, n = CASES[name](), 3
    element = reference.describe(case, numbers(case, n, Ipopt()), n)
    nlp, functions = reference.by_elements(element, n)
    x, f, g = nlp["x"], nlp["f"], nlp["g"]
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    hessian = ca.triu(ca.hessian(lam_f * f + ca.dot(lam_g, g), x)[0])
    wanted = ca.Function("wanted", [x, lam_f, lam_g], [ca.gradient(f, x), g, ca.jacobian(g, x), hessian])
    rng = np.random.default_rng(1)
    point = rng.uniform(0.4, 0.6, x.numel()), 0.7, rng.normal(size=g.numel())
    slope, rows, jacobian, curvature = (np.array(part) for part in wanted(*point))
    p = np.zeros(0)
    result = functions["jac_g"](point[0], p)
    np.testing.assert_allclose(np.array(result[0]), rows, atol=1e-12)
    np.testing.assert_allclose(np.array(result[1]), jacobian, atol=1e-9)
    np.testing.assert_allclose(np.array(functions["grad_f"](point[0], p)[1]), slope, atol=1e-12)
    np.testing.assert_allclose(np.array(functions["hess_lag"](point[0], p, *point[1:])), curvature, atol=1e-8)


@pytest.mark.slow
def test_command_writes_table_and_picture(tmp_path, capsys):
    who = ["hamel", "given", "element", "map", "sx"]
    grids = ["4", "6", "9"]
    status = benchmark.main(
        ["--problems", "P3", "--grids", *grids, "--contenders", *who, "--repeats", "1", "--output", str(tmp_path)]
    )
    assert status == 0
    printed = capsys.readouterr().out
    assert "goal 0.2" in printed
    with (tmp_path / "benchmark.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["contender"] for row in rows] == who * len(grids)
    assert all(float(row["total [s]"]) > 0.0 and row["note"] == "" for row in rows)
    assert (tmp_path / "benchmark.png").stat().st_size > 10_000


def test_missing_tools_are_rows_and_no_errors(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(peers, "missing", lambda name: "not installed")
    arguments = ["--problems", "P3", "--grids", "4", "--contenders", "hamel", "rockit", "--repeats", "1"]
    assert benchmark.main([*arguments, "--output", str(tmp_path)]) == 0
    assert "not installed" in capsys.readouterr().out
    assert '"not installed"' not in (tmp_path / "benchmark.csv").read_text()
    assert ",not installed" in (tmp_path / "benchmark.csv").read_text()


def test_failed_solve_of_this_project_is_the_only_failure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(benchmark, "own", lambda *_, **__: RunResult(note="no motion found"))
    arguments = ["--problems", "P3", "--grids", "4", "--contenders", "hamel", "element", "--repeats", "1"]
    assert benchmark.main(arguments) == 1
    assert list(tmp_path.iterdir()) == []  # files are written where the user says, and only then


def test_a_table_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "benchmark.csv"
    path.write_text("old")
    monkeypatch.setattr(benchmark, "medians", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        benchmark.write_csv({("P3", 4, "hamel"): [RunResult()]}, path)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("benchmark.csv", "old")]


def test_replayed_right_hand_side_is_the_function():
    for make in CASES.values():
        system = make().system
        function = ca.Function("rate", [system.x, system.u], [ca.densify(system.rate)])
        rng = np.random.default_rng(2)
        x, u = rng.uniform(0.3, 0.6, system.x.numel()), rng.normal(size=system.u.numel())
        np.testing.assert_allclose(peers.replay(function, [x, u], np), np.array(function(x, u)).ravel(), rtol=1e-12)
