"""
5. A machine and an effect of your own
======================================

A SCARA arm, and a hose that pulls every joint back. Nothing of the package is edited: both stand in a file of your
own, ``scara.py``.
"""

# %%
# The file
# --------

from pathlib import Path

import scara

print(Path(scara.__file__).read_text(encoding="utf-8"))

# %%
# The arm
# -------
# The drawing is made from the joints; it shows at once whether an axis points the wrong way.

from models import plots

arm = scara.scara()
plots.machine(arm, [0.6, 0.6, 0.1])

# %%
# Its fastest motion
# ------------------

from models.effects import Gravity
from models.forms import lagrange
from ocp import point_to_point, solve, uniform

system = lagrange(arm, [Gravity(), scara.HoseSpring(6.0)])
solution = solve(point_to_point(system, [-1.0, 0.8, 0.02], [1.0, 0.8, 0.15], tau=[60.0, 30.0, 80.0]), grid=uniform(40))
print(solution)
plots.motion(solution, arm)

# %%
# In scene files
# --------------
# A command that is given the file knows its machines and effects by name:
#
# .. code-block:: sh
#
#    python scripts/time_optimal.py scara.toml --with scara.py --report
#
# In Python, ``catalogue.include`` does the same.

from models.scenes import catalogue, task_file

print(catalogue.include(scara))
scene, task = task_file.load(Path(scara.__file__).with_name("scara.toml"))
print(scene.card())
