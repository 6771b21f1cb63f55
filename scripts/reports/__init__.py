"""What the commands print and write: tables, motion files, study files, budgets of effects."""

import os

# Pictures are files. A backend that Jupyter or a user chose for windows may not even be installed here.
os.environ["MPLBACKEND"] = "Agg"
