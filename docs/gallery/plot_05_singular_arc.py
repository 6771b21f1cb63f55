"""
A singular arc
==============

The problem of Aly and Chan: a mass is to stay slow and near the origin with a force between -1 and 1. The optimal
force is at its limit first, and then between its limits, where the switching function vanishes: a singular arc, which
``polish`` finds by itself.
"""

import casadi as ca

from models import plots
from ocp import Bolza, Fixed, Problem, System, along, polish, solve, start, uniform

x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
mass = System(x, u, ca.SX(0, 1), ca.vertcat(x[1], u), {"u": u}, {})
cost = Bolza(running=0.5 * (x[0] ** 2 + x[1] ** 2))
task = Problem(mass, Fixed(5.0), cost, (start(x, [0.0, 1.0]), along(u, -1.0, 1.0)))
solution = polish(solve(task, grid=uniform(50)))
print(solution.message)
print(solution.structure)
(plots.structure if solution.structure is not None else plots.motion)(solution)
