"""A million samples of a motion: seconds and memory of the torque table, beside a Python loop and Pinocchio's rnea.

Run `python scripts/benchmark_torques.py`; Pinocchio is compared with if it is installed (pip install pin).
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from models import Manipulator, Motion, inverse_dynamics, torus
from models.effects import Gravity

LOOP = 20_000  # samples of a Python loop; the rest is extrapolated


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--samples", type=int, default=1_000_000, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--smooth", action="store_true", help="time the smoothing spline of noisy samples too")
    options = parser.parse_args(arguments)
    arm, effects, count = torus(), [Gravity()], options.samples
    t = np.arange(count) * 1e-3
    exact = Motion.of_time(lambda s: [np.sin(2 * s), 0.4 + 0.3 * np.cos(5 * s), np.sin(0.5 * s) - 1.0], t[-1])
    q, v, a = exact.q(t), exact.v(t), exact.a(t)
    motion = Motion.from_samples(t, q, v, a)
    before = _peak()
    spent, table = _timed(lambda: motion.torques(arm, effects))
    print(f"torque table         {spent:8.2f} s for {count} samples, {_peak() - before:.0f} MB more at the peak")
    loads, _ = _timed(lambda: table.loads)
    split, _ = _timed(lambda: table.split)
    print(f"loads, split         {loads:8.2f} s, {split:.2f} s; peak {_peak():.0f} MB in all")
    function = inverse_dynamics(arm, effects)
    few = min(LOOP, count)
    loop, _ = _timed(lambda: [function(q[k], v[k], a[k], []) for k in range(few)])
    looped = loop * count / few
    print(f"Python loop          {looped:8.2f} s (from {few}), {looped / spent:.0f} times as long as the table")
    if options.smooth:
        noisy = q + 1e-4 * np.random.default_rng(0).normal(size=q.shape)
        smoothing, _ = _timed(lambda: Motion.from_samples(t, noisy))
        print(f"smoothing spline     {smoothing:8.2f} s, peak {_peak():.0f} MB in all")
    try:
        import pinocchio
    except ImportError:
        print("Pinocchio            not installed")
        return 0
    model = same_arm(pinocchio, arm)
    data = model.createData()
    rnea, result = _timed(lambda: [pinocchio.rnea(model, data, q[k], v[k], a[k]).copy() for k in range(few)])
    difference = np.max(np.abs(np.array(result) - table.tau[:few])) / np.max(np.abs(table.tau))
    pin = rnea * count / few
    print(f"Pinocchio {pinocchio.__version__:<10} {pin:8.2f} s (a loop, from {few}), {pin / spent:.1f} times as long")
    print(f"torques agree to     {difference:8.1e} of the largest")
    return 0


def same_arm(pinocchio: Any, arm: Manipulator) -> Any:
    """Return the torus-like manipulator as a Pinocchio model, from its bodies and joints only."""
    n = arm.nominal
    model = pinocchio.Model()
    pose = pinocchio.SE3.Identity()
    column = model.addJoint(0, pinocchio.JointModelRZ(), pose, "q1")
    spin = np.diag([0.0, 0.0, n["Theta_1_33"]])
    model.appendBodyToJoint(column, pinocchio.Inertia(0.0, np.zeros(3), spin), pose)
    parent, reach = column, np.array([0.0, n["B"], 0.0])
    for k in (2, 3):
        axis = pinocchio.JointModelRevoluteUnaligned(0.0, -1.0, 0.0)
        joint = model.addJoint(parent, axis, pinocchio.SE3(np.eye(3), reach), f"q{k}")
        tensor = np.array([[n[f"Theta_{k}_{min(i, j)}{max(i, j)}"] for j in (1, 2, 3)] for i in (1, 2, 3)])
        length = n[f"L_{k}"]
        inertia = pinocchio.Inertia(n[f"m_{k}"], np.array([length / 2.0, 0.0, 0.0]), tensor)
        model.appendBodyToJoint(joint, inertia, pose)
        parent, reach = joint, np.array([length, 0.0, 0.0])
    return model


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def _peak() -> float:
    """Return the largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
