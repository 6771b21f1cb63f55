"""
A redundant arm
===============

The Franka Panda has seven axes, one more than a pose of its hand needs. Only the position of the tool is given at the
end; the solver chooses the posture that is reached fastest.
"""

import numpy as np

from models import plots, robots
from models.effects import Gravity
from models.forms import lagrange
from ocp import Bolza, Free, Problem, along, end, solve, start, uniform

panda = robots.panda()
arm = lagrange(panda, [Gravity()])
torque, speed = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]), np.array([2.17] * 4 + [2.61] * 3)
task = Problem(arm, Free(1.0), Bolza(time=1.0), (
    start(arm["q"], [0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]), start(arm["v"], 0),
    end(arm["tool"], [0.2, 0.5, 0.4]), end(arm["v"], 0),
    along(arm["tau"], -torque, torque), along(arm["v"], -speed, speed)))  # fmt: skip
solution = solve(task, grid=uniform(12))
print(solution)
print("posture at the end", np.round(solution.signal("q", solution.duration), 3), "rad")
plots.motion(solution, panda)
