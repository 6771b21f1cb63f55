"""Write docs/machine_*.png, the drawings of the machines: python tests/writers/write_drawings.py."""

from __future__ import annotations

from pathlib import Path

import matplotlib

from models import cylindrical, plots, spherical, torus

FOLDER = Path(__file__).resolve().parents[2] / "docs"
POSITIONS = {spherical: [1.0, -0.6, 0.4, 0.7], cylindrical: [0.6, 0.5, 0.6], torus: [0.5, 0.7, -0.9]}


def main() -> None:
    """Draw every machine."""
    matplotlib.use("Agg")
    for make, position in POSITIONS.items():
        arm = make()
        plots.machine(arm, position, FOLDER / f"machine_{arm.name}.png")


if __name__ == "__main__":
    main()
