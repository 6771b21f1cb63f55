import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from accuracy_bill import simulation as accuracy
from accuracy_bill.simulation import Row, Setting, Table

from models import spherical
from models.effects import Gravity
from ocp import integrators


def test_table_and_picture(tmp_path):
    ladder = [Setting("dormand_prince_8", tol, "", integrators.dormand_prince_8(tol, tol)) for tol in (1e-4, 1e-8)]
    ladder += [Setting("runge_kutta_4", 0.4 / n, "s", integrators.runge_kutta_4(0.4 / n)) for n in (16, 32)]
    cases = accuracy.forms(spherical(), [Gravity()], [0.9, 0.1, 0.2, 0.85], [0.5, 0.3, 0.1, 0.2])
    table = accuracy.measure(cases, [1.0, 2.0, 0.1, 3.0], 0.4, ladder, repeats=2)
    assert table.reference_error < 1e-11
    assert [row.form for row in table.rows[:3]] == ["lagrange", "hamel", "canonical"]
    assert len(table.rows) == 12
    assert all(row.seconds > 0.0 and row.evaluations > 0 for row in table.rows)
    for form in cases:
        one, other = (row.error for row in table.rows if (row.form, row.method) == (form, "runge_kutta_4"))
        assert np.log2(one / other) == pytest.approx(4.0, abs=0.5)
    accuracy.draw(table, tmp_path / "a.png")
    accuracy.write_csv(table, tmp_path / "a.csv")
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 13


def test_forms_at_equal_error():
    def rows(form, factor):
        return [Row(form, "m", 10.0**-k, "", 10.0**-k, factor * 2.0**k, 1) for k in range(2, 11)]

    table = Table((*rows("lagrange", 3.0), *rows("canonical", 2.0)), 1e-14)
    seconds, sentence = accuracy.cheapest(table)
    np.testing.assert_allclose(seconds[:, 0], 1.5 * seconds[:, 1])
    assert "canonical; times its seconds: lagrange 1.50" in sentence
    # A row that is slower and worse than another changes nothing.
    worse = Table((*table.rows, Row("canonical", "n", 1.0, "", 1e-2, 1e3, 1)), 1e-14)
    np.testing.assert_array_equal(accuracy.cheapest(worse)[0], seconds)
    assert np.isnan(accuracy.cheapest(table, [1e-20])[0]).all()
