"""Stability suite: measure every hard case, and write the table and the picture of error against distance."""

from reports.command import exit_with  # first: it decides how pictures are drawn

# isort: split

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

# The cases are tests. They stay importable in the processes that measure them: these get the same search path.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the suite; 0 if every case inside the declared domain passes."""
    status: int = importlib.import_module("writers.write_stability").main(arguments)
    return status


if __name__ == "__main__":
    exit_with(main)
