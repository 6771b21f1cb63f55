"""
8. Why did my problem not solve?
================================

A solve never raises for a problem that has no solution: it returns the last iterate and a message with the limit, the
time, the amount and what to try. More of them stand on the page :doc:`/failures`.
"""

# %%
# A drive that is too weak
# ------------------------

from models import cylindrical
from models.effects import Gravity
from models.forms import canonical
from ocp import Fixed, point_to_point, solve, uniform

arm = canonical(cylindrical(), [Gravity()])
ends = ([0.0, 0.2, 0.6], [2.0, 0.8, 0.8])
weak = solve(point_to_point(arm, *ends, tau=[150.0, 600.0, 300.0]), grid=uniform(20))
print(weak.status)
print(weak.message)

# %%
# The last iterate is kept, and can be drawn: the lift is at its limit and does not carry its load.

from models import plots

plots.motion(weak, cylindrical())

# %%
# The remedy that the message names
# ---------------------------------

strong = solve(point_to_point(arm, *ends, tau=[150.0, 700.0, 300.0]), grid=uniform(20))
print(strong)

# %%
# Too little time
# ---------------
# A fixed duration below the shortest one is found out, too: the message says what is possible.

hurried = solve(point_to_point(arm, *ends, tau=[150.0, 1000.0, 300.0], horizon=Fixed(0.5)), grid=uniform(20))
print(hurried.message)

# %%
# Solved, and yet wrong
# ---------------------
# A grid can be too coarse: the equations hold at the collocation points, and the motion drifts away in between.
# ``verify`` integrates it again and says so.

from ocp import verify

coarse = solve(point_to_point(arm, *ends, tau=[150.0, 1000.0, 300.0]), grid=uniform(3))
print(verify(coarse))
