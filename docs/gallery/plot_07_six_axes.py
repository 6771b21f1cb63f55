"""
A six-axis arm
==============

The PUMA 560 with published inertia, rotors and torques, from one pose to another in the shortest time.
"""

import numpy as np

from models import plots, robots
from models.effects import Gravity
from models.forms import lagrange
from ocp import point_to_point, solve, uniform

puma = robots.puma560()
task = point_to_point(
    lagrange(puma, [Gravity()]), [0.0, 0.7, 2.4, 0.0, 0.3, 0.0], [1.2, 0.2, 2.8, 0.5, 0.8, 0.5],
    tau=np.array([97.6, 186.4, 89.4, 24.2, 20.1, 21.3]),
)  # fmt: skip
solution = solve(task, grid=uniform(20))
print(solution)
plots.motion(solution, puma)
