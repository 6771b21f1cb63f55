"""Hard cases: near degeneracies the figures stay within their tolerances; the long ones run with -m hard."""

import math
from pathlib import Path

import pytest
from matplotlib import image

from hard_cases.case import Case, Figure, run
from hard_cases.picture import draw
from hard_cases.suite import CASES
from hard_cases.table import as_csv, from_csv

pytestmark = pytest.mark.hard


@pytest.mark.parametrize(
    "case", [pytest.param(c, id=str(c), marks=[] if c.fast else [pytest.mark.slow]) for c in CASES if not c.outside]
)
def test_hard_case(case):
    finding = run(case)
    bad = [figure for figure in finding.figures if not figure.passed]
    assert finding.passed, "\n".join(map(str, bad)) or "no figure was measured"


def test_an_exception_or_no_number_never_passes():
    def breaks():
        yield Figure(0.0, 1.0)
        raise ZeroDivisionError("here")

    finding = run(Case("g", "n", "q", "", breaks))
    assert not finding.passed
    assert "ZeroDivisionError: here" in finding.worst.note
    assert not run(Case("g", "n", "q", "", lambda: [Figure(math.nan, 1.0)])).passed
    assert not run(Case("g", "n", "q", "", list)).passed
    assert run(Case("g", "n", "q", "", lambda: [Figure(0.5, 1.0)])).passed


def test_a_table_is_read_again_with_every_digit(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "stability_table.csv").read_text(encoding="utf-8")
    findings = from_csv(text)
    assert as_csv(findings).splitlines() == text.splitlines()
    draw(findings, tmp_path / "suite.png")
    assert image.imread(tmp_path / "suite.png").shape[0] > 1500


def test_every_case_has_a_name_of_its_own():
    assert len({str(case) for case in CASES}) == len(CASES)
