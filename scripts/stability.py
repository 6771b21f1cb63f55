"""Stability suite: measure every hard case, and write the table and the picture of error against distance."""

import importlib
import sys
from pathlib import Path

# The cases are tests. They stay importable in the processes that measure them: these get the same search path.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

if __name__ == "__main__":
    sys.exit(importlib.import_module("writers.write_stability").main())
