"""Write docs/orders.md, the measured orders of the schemes: python tests/writers/write_orders.py."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from transcription.test_collocation import MAKERS, ORDER, measured_orders

PAGE = Path(__file__).resolve().parents[2] / "docs" / "orders.md"
HEAD = """# Orders of convergence, measured and in theory

A smooth problem with a known solution (a point mass in polar coordinates on the straight line of least effort, its
controls collocated), by regression of the errors over grids; `python tests/writers/write_orders.py` writes this page,
and the tests hold every figure to the theory less 0.35. State and cost are taken at the ends of elements, control and
costate at the collocation points.

| scheme | cost | state | control | costate |
|---|---|---|---|---|
"""


def main() -> None:
    """Measure and write."""
    rows = []
    for name in MAKERS:
        for degree in (1, 2, 3) if name != "lobatto" else (2, 3, 4):
            measured = measured_orders(name, degree)
            ends = ORDER[name](degree)
            inside = {"radau": degree, "legendre": degree + 1, "lobatto": degree - 1}[name]
            theory = {"cost": ends, "state": ends, "control": inside, "costate": inside}
            cells = " | ".join(f"{measured[what]:.1f} / {theory[what]}" for what in theory)
            rows.append(f"| `{name}({degree})` | {cells} |\n")
    PAGE.write_text(HEAD + "".join(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
