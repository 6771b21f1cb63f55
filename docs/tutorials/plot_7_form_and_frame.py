"""
7. Which form, which frame
==========================

Three forms of the equations, several frames of the quasi-velocities: what they cost, measured on this machine while
the page is built.
"""

# %%
# Length of the right-hand side
# -----------------------------
# Instructions of x' = f(x, u) with gravity, all numbers folded in.

import casadi as ca

from models import cylindrical, spherical, torus
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange


def instructions(system):
    """Return the number of instructions of the right-hand side."""
    return ca.Function("rate", [system.x, system.u], [system.rate]).n_instructions()


print(f"{'machine':12s} {'canonical':>10s} {'hamel':>10s} {'lagrange':>10s}")
table = {}
for make in (cylindrical, spherical, torus):
    counts = [instructions(form(make(), [Gravity()])) for form in (canonical, hamel, lagrange)]
    table[make.__name__] = counts
    print(f"{make.__name__:12s} {counts[0]:10d} {counts[1]:10d} {counts[2]:10d}")

import matplotlib.pyplot as plt
import numpy as np

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
for k, form in enumerate(("canonical", "hamel", "lagrange")):
    axes.bar(np.arange(3) + 0.27 * (k - 1), [counts[k] for counts in table.values()], 0.25, label=form)
axes.set_xticks(range(3), list(table))
axes.set_ylabel("instructions of x' = f(x, u)")
axes.legend(frameon=False)

# %%
# Frames
# ------
# ``regular`` is diagonal and never singular. Others are there to compare with the paper, or for symplectic
# integrators.

for frame in ("regular", "paper", "coordinate", "ldl", "udu"):
    print(
        f"spherical, canonical, {frame:10s} {instructions(canonical(spherical(), [Gravity()], frame)):4d} instructions"
    )

# %%
# The same motion
# ---------------
# All forms find the same time. Seconds are of one solve on whatever builds this page: only ratios mean something.

from ocp import point_to_point, solve, uniform

ends, limit = ([0.0, 0.4, -0.9], [2.0, 0.8, -1.3]), [250.0, 600.0, 220.0]
for form in (canonical, hamel, lagrange):
    arm = form(torus(), [Gravity()])
    solution = solve(point_to_point(arm, *ends, tau=limit), grid=uniform(50))
    spent = solution.timings
    print(f"{form.__name__:10s} {solution.duration:.6f} s, {solution.iterations} iterations, {spent.total:.3f} s")

# %%
# Limits of speed
# ---------------
# In Lagrange form speeds are states and their limits are bounds; in the other forms they are rows of the NLP. Bounds
# are not faster as such: measure it for the task at hand.

for form in (canonical, lagrange):
    arm = form(torus(), [Gravity()])
    solution = solve(point_to_point(arm, *ends, tau=limit, v=3.0), grid=uniform(50))
    spent = solution.timings
    print(f"{form.__name__:10s} {solution.duration:.6f} s, {solution.iterations} iterations, {spent.total:.3f} s")
