"""Motions: position, velocity, acceleration and jerk as functions of the time."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from models.motions import profiles
from models.motions.coordinate_columns import check_joints
from models.motions.coordinate_labels import check_labels, labels_of, numbered
from models.motions.csv_tables import read_csv
from models.motions.function_curves import ExpressionCurve, FunctionCurve
from models.motions.motion_torques import torques_of
from models.motions.piecewise import Piecewise, dense
from models.motions.plausibility import checked, stated_by
from models.motions.recording import Recording, check_rows, named
from models.motions.ros_trajectory import read_trajectory
from models.motions.sample_fit import Differences, fit
from models.motions.smoothing import Smoothed
from models.motions.solution_curve import JoinedCurve, Recorded, SolutionCurve
from models.motions.splines import Ends, at_rest, interpolate
from models.torques.drive_loads import Envelope
from models.torques.torque_table import TorqueTable
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import Progress
from ocp.system import Label, System

Curve = Callable[[Array, int], Array]  # times (K,), order of the derivative -> (K, n)
# Times outside the motion by less than this share of the duration are moved to its ends: they are rounding errors.
OUTSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion q(t) on [start, end]; where a derivative jumps, its value is the one after the jump."""

    curve: Curve
    start: float  # [s]
    end: float  # [s]
    labels: tuple[Label, ...]  # name and unit of every coordinate
    smoothness: float  # highest order whose derivative is continuous; inf for smooth functions
    breaks: Array  # times at which a higher derivative jumps [s]
    times: Array  # rows of its tables: the times at which it was given, or about 1000 [s]
    smoothed: Smoothed | None = None  # the smoothing spline, if the motion comes from noisy samples
    samples: Array | None = None  # (K, n) positions recorded at the times, if it comes from samples
    notes: tuple[str, ...] = ()
    stated: bool = True  # whether the units are known; else torques of positions that look like degrees are refused

    def __repr__(self) -> str:
        names = ", ".join(str(label) for label in self.labels)
        return f"Motion of ({names}) from {self.start:g} to {self.end:g} s, smooth of order {self.smoothness:g}"

    @property
    def duration(self) -> float:
        """[s]."""
        return self.end - self.start

    @property
    def knots(self) -> Array:
        """Times inside the motion at which any derivative jumps, as far as they are known [s]."""
        inner = self.curve.breaks[1:-1] if isinstance(self.curve, Piecewise) else np.empty(0)
        return np.union1d(self.breaks, inner)

    def q(self, t: Array | float) -> Array:
        """Return the positions (len(t), n), or (n,) for a scalar [rad or m]."""
        return self.derivative(t, 0)

    def v(self, t: Array | float) -> Array:
        """Return the velocities [rad/s or m/s], shape as `q`."""
        return self.derivative(t, 1)

    def a(self, t: Array | float) -> Array:
        """Return the accelerations [rad/s^2 or m/s^2], shape as `q`."""
        return self.derivative(t, 2)

    def jerk(self, t: Array | float) -> Array:
        """Return the jerk [rad/s^3 or m/s^3], shape as `q`; ValueError for a motion without one, as of a Solution."""
        return self.derivative(t, 3)

    def derivative(self, t: Array | float, order: int) -> Array:
        """Return d^order q / dt^order at times t [s] within the motion, shape as `q`."""
        slack = OUTSIDE * self.duration
        checks.whole("order", order, 0, 5)
        times = checks.points("t", t, "times in s within the motion, one or (K,)", least=1)
        if not np.all((times >= self.start - slack) & (times <= self.end + slack)):
            asked = f"{np.min(times):g} .. {np.max(times):g} s"
            raise ValueError(f"t: got {asked}, the motion runs from {self.start:g} to {self.end:g} s")
        result = self.curve(np.clip(times, self.start, self.end), order)
        return result if np.ndim(t) else result[0]

    def torques(
        self,
        machine: Manipulator,
        effects: Sequence[Effect] = (),
        *,
        times: Sequence[float] | Array | None = None,
        values: dict[str, float] | None = None,
        limits: Sequence[Envelope] = (),
        progress: Progress | None = None,
    ) -> TorqueTable:
        """Return the torques of the motion by inverse dynamics.

        Args:
            machine: from `cylindrical`, `spherical` or `torus`.
            effects: such as [Gravity(), Payload(2.0)].
            times: (K,) rows of the table, increasing [s]; None: `times`. Loads and means do not depend on them.
            values: of the parameters that stay symbols, by name.
            limits: one Envelope for each drive.
            progress: called with the points done and their total number.

        Raises:
            TypeError, ValueError: see `torques_of`.
        """
        return torques_of(self, machine, effects, times, values, limits, progress)  # type: ignore[arg-type]

    def differenced(self) -> Motion:
        """Return the motion with derivatives by differences of its samples: noisy, for comparison only."""
        if self.samples is None:
            raise ValueError("the motion does not come from samples, so there is nothing to difference")
        curve = Differences.of(self.times, self.samples)
        return Motion(curve, self.start, self.end, self.labels, 0, self.breaks, self.times, samples=self.samples)

    @classmethod
    def quintic(cls, q0: object, q1: object, duration: float) -> Motion:
        """Return the polynomial of degree 5 from q0 to q1 (n,) [rad or m] with v = a = 0 at both ends, in s."""
        return cls.piecewise(profiles.rest_to_rest(q0, q1, duration, 3))

    @classmethod
    def septic(cls, q0: object, q1: object, duration: float) -> Motion:
        """Return the motion from rest to rest with v = a = jerk = 0 at both ends, of degree 7; as `quintic`."""
        return cls.piecewise(profiles.rest_to_rest(q0, q1, duration, 4))

    @classmethod
    def trapezoidal(
        cls, q0: object, q1: object, velocity: object, acceleration: object, duration: float | None = None
    ) -> Motion:
        """Return the motion of bounded velocity and acceleration; see `models.motions.profiles.trapezoidal`."""
        return cls.piecewise(profiles.trapezoidal(q0, q1, velocity, acceleration, duration))

    @classmethod
    def s_curve(
        cls, q0: object, q1: object, velocity: object, acceleration: object, jerk: object, duration: float | None = None
    ) -> Motion:
        """Return the motion of bounded velocity, acceleration and jerk; see `models.motions.profiles.s_curve`."""
        return cls.piecewise(profiles.s_curve(q0, q1, velocity, acceleration, jerk, duration))

    @classmethod
    def through(cls, times: object, waypoints: object, *, degree: int = 5, ends: Ends | None = None) -> Motion:
        """Return the interpolating spline through waypoints (K, n) [rad or m] at given times (K,), increasing [s].

        Args:
            times, waypoints: at least two.
            degree: odd; degree - 1 derivatives are continuous.
            ends: None: at rest at both ends.

        Raises:
            ValueError: shapes disagree, times do not increase, wrong end conditions, or times too close for a motion.
        """
        points = check_rows("times", times, "waypoints", waypoints)
        spline = interpolate(points.t, points.q, degree, at_rest(degree) if ends is None else ends)
        return replace(cls.piecewise(spline, (), degree - 1), stated=False, notes=points.notes)

    @classmethod
    def from_samples(
        cls,
        t: object,
        q: object,
        v: object = None,
        a: object = None,
        *,
        noise: float | Sequence[float] | None = None,
        labels: tuple[Label, ...] = (),
    ) -> Motion:
        """Return a motion from samples; v and a come from a smoothing spline, never from differences.

        Args:
            t: (K,) increasing [s].
            q: (K, n) [rad or m].
            v, a: (K, n), taken as exact where given (set-points of a controller): the motion passes through them.
            noise: standard deviation of q, scalar or (n,) [rad or m]; None: estimated; 0: none, q is interpolated.
            labels: name and unit of every coordinate; with units, large positions are not questioned.

        Raises:
            ValueError: shapes disagree, numbers that are not finite, times that do not increase, too few samples.
        """
        check_labels(labels)
        recording = Recording(t, q, v, a, labels, stated=stated_by(labels))  # type: ignore[arg-type]
        return cls.recorded(recording, noise=noise)

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        machine: Manipulator | None = None,
        *,
        noise: float | Sequence[float] | None = None,
        joints: Mapping[str, str] | None = None,
    ) -> Motion:
        """Return the motion of a CSV table; see `models.motions.csv_tables.read_csv` and `from_samples`."""
        return cls.recorded(read_csv(path, labels_of(machine), check_joints(joints)), noise=noise)

    @classmethod
    def from_trajectory(
        cls,
        path: str | os.PathLike[str],
        machine: Manipulator | None = None,
        *,
        noise: float | Sequence[float] | None = None,
        joints: Mapping[str, str] | None = None,
    ) -> Motion:
        """Return the motion of a ROS JointTrajectory file; see `models.motions.ros_trajectory.read_trajectory`."""
        labels = labels_of(machine)
        result = read_trajectory(path, [label.name for label in labels], check_joints(joints))
        return cls.recorded(named(result, labels), noise=noise)

    @classmethod
    def of(cls, solution: Recorded, system: System | None = None) -> Motion:
        """Return the motion of a Solution: q and v are its signals, a = (dv/dx) dx/dt along its interpolant.

        Args:
            solution: solved or loaded; of a Sequence all legs, one after the other.
            system: whose states they are; None: that of its problem.

        Raises:
            ValueError: no system, or the states are not those of this system.
        """
        phases = getattr(solution, "phases", None)
        curve = SolutionCurve.of(solution, system) if phases is None else JoinedCurve.of(phases, system)
        nodes = solution.nodes if isinstance(curve, SolutionCurve) else curve.nodes
        return cls(curve, 0.0, solution.duration, curve.labels, 1, nodes[1:-1], curve.times())

    @classmethod
    def of_time(
        cls,
        q: object,
        end: float,
        *,
        start: float = 0.0,
        v: Callable[[Array], Array] | None = None,
        a: Callable[[Array], Array] | None = None,
        smoothness: float = math.inf,
        labels: tuple[Label, ...] = (),
    ) -> Motion:
        """Return the motion q(t) given as a function.

        Args:
            q: a function that maps a CasADi symbol t to n expressions, or a CasADi Function; its derivatives are
                exact. With v and a: functions of times (K,) that return (K, n), and q one of them.
            start, end: [s].
            v, a: velocities and accelerations, if q is no CasADi expression.
            smoothness: highest order whose derivative is continuous, as far as it is known.
            labels: name and unit of every coordinate.

        Raises:
            TypeError, ValueError: q is neither, or the times are not in order.
        """
        for name, function in (("v", v), ("a", a)):
            if function is not None and (isinstance(function, type) or not callable(function)):
                raise TypeError(f"{name}: got {checks.shown(function)}, expected a function of times, or None")
        given = v is not None and a is not None
        curve = FunctionCurve((q, v, a)) if given else ExpressionCurve.of(q)  # type: ignore[arg-type]
        start, end = checks.number("start", start), checks.number("end", end)
        if not end > start:
            raise ValueError(f"start, end: got {start}, {end} s, expected start < end")
        check_labels(labels)
        checks.number("smoothness", smoothness, "an order of a derivative, or inf", finite=False)
        n = curve(np.array([start]), 0).shape[1]
        return cls(curve, start, end, labels or numbered(n), smoothness, np.empty(0), dense(np.array([start, end])))

    @classmethod
    def piecewise(cls, curve: Piecewise, labels: tuple[Label, ...] = (), smoothness: float | None = None) -> Motion:
        """Return the motion of a piecewise polynomial; its smoothness is computed if it is not given."""
        checks.instance("curve", curve, Piecewise, "a Piecewise polynomial")
        check_labels(labels)
        if smoothness is not None:
            checks.number("smoothness", smoothness, "an order of a derivative, inf, or None", finite=False)
        breaks, n = curve.breaks, curve.coefficients.shape[2]
        labels = labels or numbered(n)
        smoothness = curve.smoothness() if smoothness is None else smoothness
        return cls(curve, float(breaks[0]), float(breaks[-1]), labels, smoothness, breaks[1:-1], dense(breaks))

    @classmethod
    def recorded(cls, recording: Recording, *, noise: float | Sequence[float] | None = None) -> Motion:
        """Return the motion of a Recording; see `from_samples`."""
        checks.instance("recording", recording, Recording, "a Recording")
        recording = checked(recording)
        curve, smoothness, smoothed, notes = fit(recording, noise)
        t, labels, nowhere = recording.t, recording.labels, np.empty(0)
        return cls(
            curve, float(t[0]), float(t[-1]), labels, smoothness, nowhere, t, smoothed, recording.q, notes,
            recording.stated,
        )  # fmt: skip
