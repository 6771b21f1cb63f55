"""
1. The fastest motion of a scene
================================

A scene file says machine, effects, limits and task in one place. ``scripts/time_optimal.py --template spherical``
writes a commented one; here is the shortest that does something.
"""

# %%
# The file
# --------
# Angles are in rad unless a key ends in ``_deg``. Nothing in the file is executed.

from models.scenes import task_file

scene, task = task_file.of_text(
    """
machine = "spherical"

[effects.gravity]

[effects.payload]
mass = 2.0              # kg, at the tool

[limits]
q = { lower = [0.15, -3.0, -3.0, 0.6], upper = [2.8, 3.0, 3.0, 1.1] }
tau = [260.0, 160.0, 3.0, 400.0]

[task]
from = [0.9, 0.0, 0.0, 0.85]
to = { theta_deg = 92.0, psi_deg = 115.0, phi_deg = 29.0, r = 0.9 }

[[task.obstacles]]
shape = "ball"
centre = [-0.75, 1.1, 0.45]
radius = 0.2
""",
    "arm.toml",
)
print(scene.card())

# %%
# Solve and verify
# ----------------
# ``verify`` integrates the motion again with its own torques, looks between the nodes, and says what is left to gain.

from ocp import solve, uniform, verify

solution = solve(task.problem(scene.system), grid=uniform(50))
print(solution)
print(verify(solution))

# %%
# Look at it
# ----------

from models import plots

plots.motion(solution, scene.machine, obstacles=task.obstacles)

# %% In a shell the same is ``python scripts/time_optimal.py arm.toml --report``, which writes an HTML page with the
# motion in 3D and a table of what each limit is worth.
