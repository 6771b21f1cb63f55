"""
Past a point
============

The torus-like manipulator passes a point on its way. A motion through points is a sequence of problems, one for each
leg, with position and velocity continuous where they meet.
"""

from models import plots, torus
from models.effects import Gravity
from models.forms import canonical
from ocp import Bolza, Free, Problem, Sequence, along, end, solve, start, uniform

arm = canonical(torus(), [Gravity()])
limits = along(arm["tau"], [-250.0, -600.0, -220.0], [250.0, 600.0, 220.0])
legs = (
    Problem(arm, Free(0.5), Bolza(time=1.0), (
        start(arm["q"], [0.0, 0.4, -0.9]), start(arm["v"], 0), end(arm["q"], [1.0, 1.0, -1.2]), limits)),
    Problem(arm, Free(0.5), Bolza(time=1.0), (end(arm["q"], [2.0, 0.8, -1.3]), end(arm["v"], 0), limits)),
)  # fmt: skip
solution = solve(Sequence(legs, ((arm.x, arm.x),)), grid=uniform(25))
print(solution)
plots.motion(solution, torus())
