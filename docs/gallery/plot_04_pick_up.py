"""
A load picked up on the way
===========================

The arm fetches a load of 8 kg: from rest to the load, where it stops, and on with the load at its tool. The two legs
have different equations; position and velocity are continuous.
"""

from models import plots, torus
from models.effects import Gravity, Payload
from models.forms import lagrange
from ocp import Bolza, Free, Problem, Sequence, along, end, solve, start, uniform

empty = lagrange(torus(), [Gravity()])
loaded = lagrange(torus(), [Gravity(), Payload(8.0)])
limit = [250.0, 600.0, 220.0]
fetch = Problem(empty, Free(0.5), Bolza(time=1.0), (
    start(empty["q"], [0.0, 0.9, -1.2]), start(empty["v"], 0), end(empty["q"], [1.0, -0.1, -0.6]), end(empty["v"], 0),
    along(empty["tau"], [-f for f in limit], limit)))  # fmt: skip
carry = Problem(
    loaded,
    Free(0.5),
    Bolza(time=1.0),
    (end(loaded["q"], [2.0, 0.8, -1.3]), end(loaded["v"], 0), along(loaded["tau"], [-f for f in limit], limit)),
)
solution = solve(Sequence((fetch, carry), ("q", "v")), grid=uniform(20))
print([round(leg.duration, 4) for leg in solution.phases], "s")
plots.motion(solution, torus())
