"""Motions: q, v and a (and the jerk) of the time, whatever they were made from."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from models.motions import profiles
from models.motions.csv_tables import read_csv
from models.motions.function_curves import ExpressionCurve, FunctionCurve
from models.motions.piecewise import Piecewise, dense
from models.motions.recording import Recording, check_labels, check_rows
from models.motions.ros_trajectory import read_trajectory
from models.motions.sample_fit import Differences, fit
from models.motions.smoothing import Smoothed
from models.motions.solution_curve import Recorded, SolutionCurve
from models.motions.splines import Ends, at_rest, interpolate
from models.torques.drive_loads import Envelope
from models.torques.torque_table import TorqueTable, tabulate
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import Progress
from ocp.system import Label, System

Curve = Callable[[Array, int], Array]  # times (K,), order of the derivative -> (K, n)
# Times outside the motion by less than this share of the duration are rounding.
OUTSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion q(t) on [start, end]; one-sided values from the right where a derivative jumps."""

    curve: Curve
    start: float  # [s]
    end: float  # [s]
    labels: tuple[Label, ...]  # name and unit of every coordinate
    smoothness: float  # highest order whose derivative is continuous; inf for smooth functions
    breaks: Array  # times at which a higher derivative jumps [s]
    times: Array  # at which the motion was given, or a dense set [s]
    smoothed: Smoothed | None = None  # the smoothing spline, if the motion comes from noisy samples
    samples: Array | None = None  # (K, n) positions recorded at the times, if it comes from samples
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        names = ", ".join(str(label) for label in self.labels)
        return f"Motion of ({names}) from {self.start:g} to {self.end:g} s, smooth of order {self.smoothness:g}"

    @property
    def duration(self) -> float:
        """[s]."""
        return self.end - self.start

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
        """Return the jerk [rad/s^3 or m/s^3], shape as `q`.

        Raises:
            ValueError: the motion has none, as one of a Solution.
        """
        return self.derivative(t, 3)

    def derivative(self, t: Array | float, order: int) -> Array:
        """Return d^order q / dt^order at times t [s] within the motion, shape as `q`."""
        slack = OUTSIDE * self.duration
        checks.whole("order", order, 0, 5)
        times = checks.places("t", t, "times in s within the motion, one or (K,)", least=1)
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
            times: (K,) increasing [s]; None: those of the motion.
            values: of the parameters that stay symbols, by name.
            limits: one Envelope for each drive.
            progress: called with the points done and in all.

        Raises:
            TypeError, ValueError: as `inverse_dynamics`; sizes or times that do not fit.
        """
        chosen = checks.numbers("times", self.times if times is None else times)
        if chosen.ndim != 1 or len(chosen) < 2 or not np.all(np.diff(chosen) > 0.0):
            raise checks.refused("times", times, "at least two increasing times")
        covariance = None if self.smoothed is None else self.smoothed.covariance
        return tabulate(
            machine, effects, chosen, self.derivative, smoothness=self.smoothness, values=values,
            covariance=covariance, limits=limits, notes=self.notes, progress=progress,
        )  # fmt: skip

    def differenced(self) -> Motion:
        """Return what raw differences of the samples would give: a comparison, no basis for torques.

        Raises:
            ValueError: the motion does not come from samples.
        """
        if self.samples is None:
            raise ValueError("the motion does not come from samples, so there is nothing to difference")
        curve = Differences.of(self.times, self.samples)
        return Motion(curve, self.start, self.end, self.labels, 0, self.breaks, self.times, samples=self.samples)

    @classmethod
    def quintic(cls, q0: object, q1: object, duration: float) -> Motion:
        """Return the motion from rest to rest with v = a = 0 at both ends, q a polynomial of degree 5.

        Args:
            q0, q1: (n,) [rad or m].
            duration: [s].
        """
        return cls.piecewise(profiles.rest_to_rest(q0, q1, duration, 3))

    @classmethod
    def septic(cls, q0: object, q1: object, duration: float) -> Motion:
        """Return the motion from rest to rest with v = a = jerk = 0 at both ends, of degree 7; as `quintic`."""
        return cls.piecewise(profiles.rest_to_rest(q0, q1, duration, 4))

    @classmethod
    def trapezoidal(
        cls, q0: object, q1: object, velocity: object, acceleration: object, duration: float | None = None
    ) -> Motion:
        """Return the motion of bounded velocity and acceleration; see `models.profiles.trapezoidal`."""
        return cls.piecewise(profiles.trapezoidal(q0, q1, velocity, acceleration, duration))

    @classmethod
    def s_curve(
        cls, q0: object, q1: object, velocity: object, acceleration: object, jerk: object, duration: float | None = None
    ) -> Motion:
        """Return the motion of bounded velocity, acceleration and jerk; see `models.profiles.s_curve`."""
        return cls.piecewise(profiles.s_curve(q0, q1, velocity, acceleration, jerk, duration))

    @classmethod
    def through(cls, times: object, waypoints: object, *, degree: int = 5, ends: Ends | None = None) -> Motion:
        """Return the interpolating spline through waypoints at given times.

        Args:
            times: (K,) increasing [s].
            waypoints: (K, n) [rad or m].
            degree: odd; degree - 1 derivatives are continuous.
            ends: None: at rest at both ends.

        Raises:
            ValueError: shapes disagree, times do not increase, wrong end conditions.
        """
        check_rows("times", times, "waypoints", waypoints)
        points = Recording(times, waypoints)  # type: ignore[arg-type]
        spline = interpolate(points.t, points.q, degree, at_rest(degree) if ends is None else ends)
        return cls.piecewise(spline, points.labels, degree - 1)

    @classmethod
    def from_samples(
        cls, t: object, q: object, v: object = None, a: object = None, *, noise: float | Sequence[float] | None = None
    ) -> Motion:
        """Return a motion from samples; v and a come from a smoothing spline, never from differences.

        Args:
            t: (K,) increasing [s].
            q: (K, n) [rad or m].
            v, a: (K, n), taken as exact where given (set-points of a controller): the motion passes through them.
            noise: standard deviation of q, scalar or (n,) [rad or m]; None: estimated; 0: none, q is interpolated.

        Raises:
            ValueError: shapes disagree, numbers that are not finite, times that do not increase, too few samples.
        """
        return cls.recorded(Recording(t, q, v, a), noise=noise)  # type: ignore[arg-type]

    @classmethod
    def from_csv(
        cls,
        path: str | os.PathLike[str],
        machine: Manipulator | None = None,
        *,
        noise: float | Sequence[float] | None = None,
    ) -> Motion:
        """Return the motion of a CSV table; see `models.table_file.read_csv` and `from_samples`."""
        return cls.recorded(read_csv(path, labels_of(machine)), noise=noise)

    @classmethod
    def from_trajectory(
        cls,
        path: str | os.PathLike[str],
        machine: Manipulator | None = None,
        *,
        noise: float | Sequence[float] | None = None,
    ) -> Motion:
        """Return the motion of a ROS JointTrajectory file; see `models.recording.read_trajectory`."""
        return cls.recorded(read_trajectory(path, [label.name for label in labels_of(machine)]), noise=noise)

    @classmethod
    def of(cls, solution: Recorded, system: System | None = None) -> Motion:
        """Return the motion of a Solution: q and v are its signals, a = (dv/dx) dx/dt along its interpolant.

        Args:
            solution: solved or loaded.
            system: whose states they are; None: that of its problem.

        Raises:
            ValueError: no system, or the states are not those of this system.
        """
        curve = SolutionCurve.of(solution, system)
        return cls(curve, 0.0, solution.duration, curve.labels, 1, solution.nodes[1:-1], curve.times())

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
            smoothness: what is known of q.
            labels: name and unit of every coordinate.

        Raises:
            TypeError, ValueError: q is none of these.
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
        """Return the motion of a piecewise polynomial; its smoothness is found out if it is not known."""
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
        curve, smoothness, smoothed, notes = fit(recording, noise)
        t, labels = recording.t, recording.labels
        return cls(curve, float(t[0]), float(t[-1]), labels, smoothness, np.empty(0), t, smoothed, recording.q, notes)


def labels_of(machine: Manipulator | None) -> tuple[Label, ...]:
    """Return names and units of the coordinates of a machine; none without one."""
    checks.instance("machine", machine, Manipulator | None, "a Manipulator such as spherical(), or None")
    return () if machine is None else tuple(Label(c.name, c.unit) for c in machine.coordinates)


def numbered(n: int) -> tuple[Label, ...]:
    """Return the labels q1 .. qn."""
    return tuple(Label(f"q{i + 1}") for i in range(n))
