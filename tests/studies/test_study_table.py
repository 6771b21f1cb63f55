"""The table of a study: columns, gaps, exports, what matters, jumps."""

import csv
import math

import casadi as ca
import numpy as np
import pytest
from catalogue.studies import QUIET, cart, carts

from ocp import (
    Bolza,
    Fixed,
    LatinHypercube,
    Problem,
    Product,
    Study,
    System,
    along,
    solve,
    start,
    uniform,
    verify,
)  # fmt: skip
from ocp.studies.designs import Zip
from ocp.studies.main_effects import influences, jumps


def product(a, b, form="x"):
    if a == 3.0 and b == 2.0:
        raise ValueError("no way")
    return {"value": a**2 * b**-0.5, "sum": a + b}


AXES = {"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0]}


@pytest.fixture(scope="module")
def table():
    return Study(product, over=AXES).run()


def test_columns_and_gaps(table):
    assert table.columns == ("a", "b", "status", "way", "message", "resolved", "verified", "seconds", "value", "sum")
    assert table.axes == ("a", "b")
    np.testing.assert_allclose(table["value"][:-1], [1.0, 0.5**0.5, 4.0, 4.0 * 0.5**0.5, 9.0])
    assert math.isnan(table["value"][-1])
    assert table.grid("sum").shape == (3, 2)
    assert np.isnan(table.grid("sum")).sum() == 1
    assert len(list(table)) == len(table) == 6
    assert table.failures.keys() == {5}
    assert set(table.as_arrays()) == set(table.columns)
    with pytest.raises(KeyError, match=r"no column 'v'.*value"):
        table["v"]
    with pytest.raises(ValueError, match="nothing is stored for case 5"):
        table.solution(5)


def test_a_column_costs_one_look_at_every_case(monkeypatch):
    table, looks = Study(product, over=AXES).run(), []
    row = type(table).row
    monkeypatch.setattr(type(table), "row", lambda self, number: looks.append(number) or row(self, number))
    for name in (*table.columns, *table.columns):
        assert len(table[name]) == 6
    assert sorted(looks) == [0, 1, 2, 3, 4, 5]
    table["sum"][:] = 0.0  # a copy
    assert table["sum"][0] == 2.0


def test_csv_has_every_digit(table, tmp_path):
    table.write_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["value"]) for row in rows[:-1]] == list(table["value"][:-1])
    assert rows[-1]["value"] == "nan"
    assert "no way" in rows[-1]["message"]
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


X, U = ca.SX.sym("x"), ca.SX.sym("u")
LAG = System(X, U, ca.SX(0, 1), 20.0 * (U - X), {"x": X}, {})


def stiff(elements):
    problem = Problem(
        LAG, horizon=Fixed(1.0), minimise=Bolza(running=(X - 1.0) ** 2 + 0.1 * U**2),
        subject_to=(start(X, 0.0), along(U, -1.0, 1.0)),
    )  # fmt: skip
    return solve(problem, grid=uniform(elements), solver=QUIET)


def test_units_stand_in_the_header(table, tmp_path):
    table.write_csv(tmp_path / "t.csv", {"a": "kg", "value": "m/s"})
    header = (tmp_path / "t.csv").read_text().splitlines()[0]
    assert header == "a [kg],b,status,way,message,resolved,verified,seconds [s],value [m/s],sum"


def test_a_grid_that_does_not_resolve_the_motion_is_not_hidden_behind_solved():
    """x' = 20 (u - x), |u| <= 1, is stiff: elements of half a second cannot follow it, of a hundredth they can."""
    table = Study(stiff, over={"elements": [2, 200]}).run()
    assert np.all(table.ok)
    assert list(table["resolved"]) == ["no", "yes"]
    assert table.unresolved == (0,)
    assert "does not resolve the motion: 1 cases (0)" in str(table)
    assert set(table["verified"]) == {""}
    assert set(Study(product, over={"a": [1.0], "b": [1.0]}).run()["resolved"]) == {""}


def test_solutions_are_verified_where_asked():
    study = dict(over={"mass": [1.0, 2.0], "limit": [1.0]}, grid=uniform(40))
    plain, verified = carts(**study).run(), carts(**study, verified=True).run()
    assert set(plain["verified"]) == {""}
    assert set(verified["verified"]) == {"yes" if verify(solve(cart(), grid=uniform(40), solver=QUIET)).ok else "no"}
    assert verified.records[0].id != plain.records[0].id
    assert "verified" not in verified.results


def test_parquet_and_pandas(table, tmp_path):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed (extra tables)")
    pytest.importorskip("pyarrow", reason="PyArrow is not installed (extra tables)")
    table.write_parquet(tmp_path / "t.parquet")
    read = pandas.read_parquet(tmp_path / "t.parquet")
    pandas.testing.assert_frame_equal(read, table.as_pandas())
    assert list(read.columns) == list(table.columns)


def test_xarray_has_the_axes_as_coordinates(table):
    pytest.importorskip("xarray", reason="xarray is not installed (extra tables)")
    data = table.as_xarray()
    assert float(data["value"].sel(a=2.0, b=1.0)) == 4.0
    assert data["sum"].dims == ("a", "b")


@pytest.mark.parametrize("name", ["pandas", "xarray", "pyarrow"])
def test_a_missing_library_is_named_with_its_cure(table, tmp_path, monkeypatch, name):
    monkeypatch.setitem(__import__("sys").modules, name, None)
    calls = {
        "pandas": table.as_pandas,
        "xarray": table.as_xarray,
        "pyarrow": lambda: table.write_parquet(tmp_path / "t"),
    }
    with pytest.raises(ImportError, match=f"pip install {name}"):
        calls[name]()


def test_elasticities_of_a_power_law():
    # y = a^2 b^-1/2 close to (1, 1): two percent and minus half a percent for one percent.
    near = Product({"a": np.linspace(0.98, 1.02, 5), "b": np.linspace(0.98, 1.02, 5)})
    table = Study(product, over=near).run()
    rows = {row.axis: row for row in influences(table, "value")}
    assert rows["a"].elasticity == pytest.approx(2.0, abs=2e-3)
    assert rows["b"].elasticity == pytest.approx(-0.5, abs=2e-3)
    assert next(iter(rows)) == "a"
    assert rows["a"].effect == pytest.approx(0.08, rel=1e-2)
    assert rows["b"].effect == pytest.approx(-0.02, rel=1e-2)
    assert rows["a"].share == pytest.approx(16.0 / 17.0, rel=1e-2)


def test_scattered_cases_are_ranked_as_well():
    pytest.importorskip("scipy", reason="SciPy is not installed (extra study)")
    table = Study(product, over=LatinHypercube({"a": (0.9, 1.1), "b": (0.9, 1.1)}, 40)).run()
    rows = influences(table, "sum")
    for row in rows:
        assert row.slope == pytest.approx(1.0, abs=1e-10)
    with pytest.raises(ValueError, match="at least one axis"):
        influences(Study(product, over={"a": [1.0], "b": [1.0]}).run(), "sum")


def branch(a, form="one"):
    return {"cost": a + (0.5 if a > 4.5 else 0.0)}


def test_a_jump_between_neighbours_is_found():
    table = Study(branch, over={"a": np.arange(10.0)}).run()
    assert jumps(table) == ((4, 5),)
    smooth = Study(product, over={"a": np.linspace(1.0, 2.0, 12), "b": np.linspace(3.0, 4.0, 12)}).run()
    assert jumps(smooth, "value") == ()


def test_a_zip_has_no_grid():
    with pytest.raises(ValueError, match="design is Zip"):
        Study(product, over=Zip({"a": [1.0, 2.0], "b": [1.0, 1.0]})).run().grid("sum")
