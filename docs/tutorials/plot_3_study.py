"""
3. A parameter study
====================

How does the shortest time depend on the load and on the strength of the drives? A study solves all cases, each from
its neighbour, and stores them.
"""

# %%
# What varies
# -----------
# ``Parameter`` keeps the mass a symbol: one NLP serves all loads. The strength of the drives is an argument of the
# function.

from models import Parameter, plots, spherical
from models.effects import Gravity, Payload
from models.forms import canonical
from ocp import Study, point_to_point, uniform

arm = canonical(spherical(), [Gravity(), Payload(Parameter(2.0))])


def shortest(strength):
    """Return the task with drives of this strength."""
    drives = [strength * f for f in (260.0, 160.0, 3.0, 400.0)]
    return point_to_point(arm, [0.9, 0.0, 0.0, 0.85], [1.6, 2.0, 0.5, 0.9], tau=drives)


over = {"payload.mass": [0.0, 1.0, 2.0, 3.0, 4.0], "strength": [0.9, 1.0, 1.1, 1.2]}
table = Study(shortest, over, grid=uniform(25)).run()
print(table)

# %%
# Results
# -------
# ``store="study.db"`` would keep the cases: ``run()`` then goes on where it stopped, even after the process was
# killed.

plots.study(table, "duration", {"duration": "s", "payload.mass": "kg"})

# %%
# What it depends on
# ------------------
# The elasticity is the change in percent for one percent of the axis.

from ocp.studies.main_effects import influences

for row in influences(table, "duration"):
    print(f"{row.axis:14s} elasticity {row.elasticity:+.3f}, share {100 * row.share:.0f} %")
