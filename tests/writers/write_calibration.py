"""Write docs/calibration.md, estimated against true errors: python tests/writers/write_calibration.py [--quick]."""

from __future__ import annotations

import sys
from itertools import groupby
from pathlib import Path

import numpy as np

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from catalogue.calibration import GRIDS, KNOWN, QUICK, SCHEMES, measure, summary

PAGE = Path(__file__).resolve().parents[2] / "docs" / "calibration.md"
HEAD = """# Estimated against true errors of the cost

Problems with a known optimum{left}, on {grids} elements, with {schemes} schemes and shapes of the control; a true
error within 1e-11 of the cost, or within the digits of the optimum, is left out. "bounded" is the share of cases in
which the estimate of `estimate(solution).cost` is not below the true error. `python tests/writers/write_calibration.py`
writes this page.

All cases: {count}, bounded {bounded:.1%}, estimate over true error in the median {median:.2f}.

| problem | cases | bounded | true errors | estimate / true error: median | largest |
|---|---|---|---|---|---|
"""


def main() -> None:
    """Measure and write."""
    names = QUICK if "--quick" in sys.argv else tuple(KNOWN)
    cases = [case for case in measure(names) if not case.rounding]
    bounded, median = summary(cases)
    rows = []
    for name, group in groupby(cases, key=lambda case: case.name):
        own = list(group)
        ratios, true = [case.ratio for case in own], [case.true for case in own]
        share = np.mean([case.bounded for case in own])
        rows.append(
            f"| {name} | {len(own)} | {share:.0%} | {min(true):.0e} .. {max(true):.0e} "
            f"| {np.median(ratios):.2f} | {max(ratios):.2g} |\n"
        )
    grids = ", ".join(map(str, GRIDS))
    missing = [name for name in KNOWN if name not in names]
    left = f" (left out by --quick: {', '.join(missing)})" if missing else ""
    head = HEAD.format(left=left, grids=grids, schemes=len(SCHEMES), count=len(cases), bounded=bounded, median=median)
    PAGE.write_text(head + "".join(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
