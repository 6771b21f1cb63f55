"""Times at a fixed rate, as controllers expect them."""

from __future__ import annotations

import numpy as np

from models.motions.motion import Motion
from ocp import checks
from ocp.checks import Array


def times_at_rate(motion: Motion, rate: float) -> Array:
    """Return the times start + k / rate up to the end of a motion, which is the last one in any case [s].

    Args:
        motion: q(t).
        rate: rows for a second [1/s].

    Raises:
        ValueError: fewer than one row in the motion, or more than ten million.
    """
    checks.number("rate", rate, "a number > 0 in 1/s", above=0.0)
    count = motion.duration * rate
    if not 1.0 <= count <= 1e7:
        raise ValueError(f"rate: {rate:g} 1/s gives {count:.3g} rows of {motion.duration:.4g} s, expected 1 .. 1e7")
    times = motion.start + np.arange(int(count * (1.0 + 1e-12)) + 1) / rate
    if motion.end - times[-1] > 1e-9 / rate:
        return np.append(times, motion.end)
    times[-1] = motion.end
    return times
