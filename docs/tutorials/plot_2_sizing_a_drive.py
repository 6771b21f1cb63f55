"""
2. Sizing drives from a recording
=================================

Joint angles were recorded at 200 Hz with some noise. What torque, speed and power does each drive need for that
motion with a heavier load?
"""

# %%
# The recording
# -------------
# A CSV table with the columns t, q1, q2, q3. Here it is made up: a swing and 0.1 mrad of noise.

import tempfile
from pathlib import Path

import numpy as np

t = np.arange(0.0, 3.0, 0.005)
q = np.stack([0.8 * np.sin(2.0 * t), 0.6 + 0.3 * np.cos(3.0 * t), -1.0 + 0.4 * np.sin(1.5 * t)], axis=1)
q += np.random.default_rng(1).normal(scale=1e-4, size=q.shape)
file = Path(tempfile.mkdtemp()) / "recording.csv"
np.savetxt(file, np.column_stack([t, q]), delimiter=",", header="t,q1,q2,q3", comments="")

# %%
# Torques with their uncertainty
# ------------------------------
# Samples are never differenced: a smoothing spline finds its own strength, and the noise that is left reaches the
# torques as a standard deviation.

from models import Envelope, Motion, plots, torus
from models.effects import Gravity, Payload

motion = Motion.from_csv(file)
drives = [Envelope(peak=300.0, speed=4.0, corner=2.5), Envelope(peak=450.0, speed=4.0), Envelope(peak=150.0, speed=4.0)]
table = motion.torques(torus(), [Gravity(), Payload(10.0)], limits=drives)
print(table)
for load in table.loads:
    if load.exceeded:
        span = load.exceeded[0]
        print(f"{load.name} is asked for {span.ratio:.2f} times what it has from {span.start:.2f} to {span.end:.2f} s")
print("standard deviation of the torques", np.round(np.sqrt(np.mean(table.uncertainty**2, axis=0)), 2), "N m")

# %%
# Which drive, and why
# --------------------
# The left column splits each torque by cause; the third shows it over speed, with the limits of the drive dashed.

plots.torques(table)
