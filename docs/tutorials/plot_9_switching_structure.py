"""
9. Reading a switching structure
================================

In the shortest time most drives are at a limit most of the time. The switching structure shows
which, when, and why.
"""

# %%
# From controls to arcs
# ---------------------
# On a grid the switches fall inside of elements. ``polish`` reads the arcs off the solution and makes the switching
# times unknowns.

from models import plots, torus
from models.effects import Gravity
from models.forms import canonical
from ocp import point_to_point, polish, sensitivity, solve, uniform

arm = canonical(torus(), [Gravity()])
task = point_to_point(arm, [0.0, 0.4, -0.9], [2.0, 0.8, -1.3], tau=[250.0, 600.0, 220.0])
solution = solve(task, grid=uniform(50))
best = polish(solution)
print(f"{solution.duration:.6f} s on the grid, {best.duration:.10f} s polished")
print(best.structure)

# %%
# Why a drive is where it is
# --------------------------
# Below each drive stands its switching function, the derivative of the Hamiltonian with respect to the torque. Where
# it is positive the lower limit is optimal, where it is negative the upper one; it crosses zero at the switches.

plots.structure(best)

# %%
# What a limit is worth
# ---------------------
# The derivative of the shortest time with respect to the limits of one drive, without solving again, and the same by
# solving again.

stronger = point_to_point(arm, [0.0, 0.4, -0.9], [2.0, 0.8, -1.3], tau=[251.0, 600.0, 220.0])
slope = sensitivity(best, toward={"1 N m more for q1": stronger})
print(slope)
again = polish(solve(stronger, grid=uniform(50)))
print(f"solved again: {again.duration - best.duration:.6e} s for 1 N m")
