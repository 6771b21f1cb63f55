"""
The fastest motion of the spherical manipulator
===============================================

Rest to rest under gravity. All four drives are at their limits nearly all the time; the arm is drawn in as far as it
may be, which makes it easier to turn. ``polish`` makes the switching times unknowns.
"""

from models import plots, spherical
from models.effects import Gravity
from models.forms import canonical
from ocp import point_to_point, polish, solve

arm = canonical(spherical(), [Gravity()])
task = point_to_point(
    arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9],
    q=([0.15, -3.0, -3.0, 0.6], [2.8, 3.0, 3.0, 1.1]), tau=[260.0, 160.0, 3.0, 400.0],
)  # fmt: skip
best = polish(solve(task))
print(best.structure)
plots.motion(best, spherical())
