"""What the commands print and write: tables, motion files, study files, budgets of effects."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

# Pictures are files. A backend that Jupyter or a user chose for windows may not even be installed here.
os.environ["MPLBACKEND"] = "Agg"
# A command may be called by a Python in which nothing is installed.
if find_spec("models") is None:
    sys.path.append(str(Path(__file__).resolve().parents[2]))
if find_spec("casadi") is None:
    sys.exit(
        f"{Path(sys.argv[0]).name}: CasADi is not installed for {sys.executable}; in the folder of the clone: "
        "python3 -m venv .venv && .venv/bin/pip install -e . (see README.md), then .venv/bin/python or .venv/bin/hamel"
    )
