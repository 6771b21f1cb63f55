"""Torques of a motion as a table, their split, their uncertainty, and the load of every drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from models.torques.drive_loads import DriveLoad, Envelope, loads_of
from models.torques.resolved_rows import resolve_rows
from models.torques.shaft import Shaft, gear_ratios, shafts
from models.torques.time_means import rms
from models.torques.torque_functions import DERIVATIVES, drive_dynamics, inverse_dynamics, time_column
from models.torques.torque_split import split_torques
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import CHUNK, Progress, evaluate

Derivative = Callable[[Array, int], Array]  # times (K,), order -> (K, n) of a motion
Covariance = Callable[[Array], Array]  # times (K,) -> (K, n, 3, 3) of position, velocity, acceleration
NO_KNOTS = np.empty(0)


@dataclass(frozen=True, eq=False)
class TorqueTable:
    """t, q, v, a, tau of a motion, one row for each time.

    Loads, limits and means are those of the motion, not of the rows: between the rows it is evaluated at further
    times, until torques and speeds are linear between them to 5e-5 of their peaks (see `resolved`).
    """

    t: Array  # (K,) [s]
    q: Array  # (K, n) [rad or m]
    v: Array  # (K, n)
    a: Array  # (K, n)
    tau: Array  # (K, n) generalised drive forces along +q [N m or N]
    machine: Manipulator
    effects: tuple[Effect, ...]
    parameters: Array  # values of the parameters that stay symbols
    derivative: Derivative
    smoothness: float = np.inf  # of the motion
    covariance: Covariance | None = None  # of q, v, a, if they come from noisy samples
    limits: tuple[Envelope, ...] = ()  # of the drives, or none
    notes: tuple[str, ...] = field(default=())
    knots: Array = field(default_factory=lambda: NO_KNOTS)  # times at which a derivative of the motion jumps [s]

    @property
    def power(self) -> Array:
        """(K, n) tau v of every drive [W]."""
        return np.asarray(self.tau * self.v)

    @cached_property
    def resolved(self) -> TorqueTable:
        """The table with further rows, between which torques and speeds are linear to 5e-5 of their peaks."""
        rows, notes = resolve_rows(self)  # type: ignore[arg-type]  # its attributes are read only
        for symbol in ("q", "v", "a", "tau"):
            check_finite(symbol, rows[symbol], rows["t"], self.machine)
        result = replace(self, **rows, notes=(*self.notes, *notes))  # type: ignore[arg-type]
        result.__dict__["resolved"] = result
        return result

    def rms(self, values: Array) -> Array:
        """Return the root mean square over time (n,) of quantities (K, n) at the rows, linear between them.

        Raises:
            ValueError: another number of rows, or values that are not finite.
        """
        given = checks.numbers("values", values, f"finite numbers, {len(self.t)} rows")
        if given.ndim != 2 or len(given) != len(self.t):
            raise checks.refused("values", values, f"finite numbers, {len(self.t)} rows")
        return rms(self.t, given)

    @cached_property
    def split(self) -> dict[str, Array]:
        """Name of a contribution -> its torque (K, n); they add up to tau.

        "inertia" and "coriolis" are those of the bare machine; every effect that acts on the joints has one entry.
        """
        function = split_torques(self.machine, self.effects)
        result = evaluate(function, self.q, self.v, self.a, self.parameters, *time_column(function, self.t))
        return dict(zip(function.name_out(), result, strict=True))

    @cached_property
    def tool(self) -> Array:
        """(K, 3) position of the tool [m]."""
        symbols = list(self.machine.symbols.values())
        p = ca.vertcat(*symbols) if symbols else ca.SX(0, 1)
        position = ca.Function("tool", [self.machine.q, p], [ca.densify(self.machine.tool)])
        return evaluate(position, self.q, self.parameters[: len(symbols)])[0]

    @cached_property
    def uncertainty(self) -> Array | None:
        """(K, n) standard deviation of tau that the noise of the samples leaves [N m or N]; None without noise.

        Var(tau_i) = sum_j g_ij' C_j g_ij,  g_ij = d tau_i / d (q_j, v_j, a_j), C_j the covariance of coordinate j
        """
        if self.covariance is None:
            return None
        torques = inverse_dynamics(self.machine, self.effects)
        inputs = torques.sx_in()
        slope = ca.jacobian(torques(*inputs), ca.vertcat(*inputs[:3]))
        slopes = ca.Function("slopes", inputs, [ca.densify(slope)])
        n = self.q.shape[1]
        result = np.empty_like(self.q)
        for start in range(0, len(self.t), CHUNK):
            part = slice(start, start + CHUNK)
            time = time_column(torques, self.t[part])
            (results,) = evaluate(slopes, self.q[part], self.v[part], self.a[part], self.parameters, *time)
            gradient = results.reshape(-1, 3, n, n)  # point, order, coordinate, torque
            variance = np.einsum("kbji,kjbc,kcji->ki", gradient, self.covariance(self.t[part]), gradient, optimize=True)
            result[part] = np.sqrt(np.maximum(variance, 0.0))
        return result

    @cached_property
    def loads(self) -> tuple[DriveLoad, ...]:
        """Load of each drive along the motion, also between the rows."""
        coordinates, rows = self.machine.coordinates, self.resolved
        names, units = tuple(f"tau_{c.name}" for c in coordinates), tuple(c.force_unit for c in coordinates)
        return loads_of(names, units, rows.t, rows.v, rows.tau, self.limits)

    @cached_property
    def drives(self) -> dict[str, Array]:
        """Name -> (K, n) quantities of the drives: motor_q, motor_v, motor_tau, current, voltage, command ...

        Positions, velocities and torques of the motors are in units of the joints; see `shaft` for the motor side.

        Raises:
            ValueError: the motion at one instant does not fix the drives, or it is not smooth enough for them.
        """
        _, orders = self._drive_function
        if max(orders) - 1 > self.smoothness:
            raise ValueError(
                f"the drives need the {DERIVATIVES[max(orders)]} of the motion, but its "
                f"{DERIVATIVES[int(self.smoothness) + 1]} jumps; use a smoother motion, such as a septic or a spline"
            )
        return self.drives_at(self.t)

    @cached_property
    def _drive_function(self) -> tuple[ca.Function, list[int]]:
        """Return the drive dynamics and the orders of the derivatives that they need."""
        function = drive_dynamics(self.machine, self.effects)
        return function, [DERIVATIVES.index(name) for name in function.name_in() if name in DERIVATIVES]

    def drives_at(self, t: Array) -> dict[str, Array]:
        """Return the quantities of the drives at times (K,) of the motion.

        Raises:
            ValueError: a time outside of the motion, and as `drives`.
        """
        t = np.atleast_1d(checks.points("t", t, "times in s within the motion", self.t[0], self.t[-1], least=1))
        function, orders = self._drive_function
        moved = [self.derivative(t, order) for order in orders]
        result = evaluate(function, *moved, self.parameters, *time_column(function, t))
        return dict(zip(function.name_out()[1:], result[1:], strict=True))

    @cached_property
    def shaft(self) -> Shaft | None:
        """Torque, speed and power at the shafts of the motors; None if no effect has a gear ratio.

        Raises:
            ValueError: as `drives`.
        """
        ratios = gear_ratios(self.machine, self.effects)
        return None if ratios is None else shafts(ratios, self.drives["motor_v"], self.drives["motor_tau"])

    @property
    def header(self) -> list[str]:
        """Names and units of the columns t, q, v, a, tau."""
        coordinates = self.machine.coordinates
        columns = ["t [s]", *(f"{c.name} [{c.unit}]" for c in coordinates)]
        columns += [f"d{c.name}/dt [{c.unit}/s]" for c in coordinates]
        columns += [f"d2{c.name}/dt2 [{c.unit}/s^2]" for c in coordinates]
        return columns + [f"tau_{c.name} [{c.force_unit}]" for c in coordinates]

    @property
    def rows(self) -> Array:
        """(K, 1 + 4 n) the numbers under the header."""
        return np.hstack([self.t[:, None], self.q, self.v, self.a, self.tau])

    def __str__(self) -> str:
        cells = [["drive", "peak", "rms", "speed", "mean power", "peak power", "braking", "energy", "recovered"]]
        for load, c in zip(self.loads, self.machine.coordinates, strict=True):
            torques = [f"{load.peak:.5g} {load.unit}", f"{load.rms:.5g} {load.unit}"]
            powers = [f"{power:.4g} W" for power in (load.mean_power, load.peak_power, load.peak_braking)]
            energies = [f"{energy:.4g} J" for energy in (load.motor_energy, load.brake_energy)]
            cells.append([load.name, *torques, f"{load.speed:.4g} {c.unit}/s", *powers, *energies])
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        rows = ((row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])) for row in cells)
        return "\n".join("   ".join(row) for row in rows)


def tabulate(
    machine: Manipulator,
    effects: Sequence[Effect],
    t: Array,
    derivative: Derivative,
    *,
    smoothness: float = np.inf,
    values: dict[str, float] | None = None,
    covariance: Covariance | None = None,
    limits: Sequence[Envelope] = (),
    notes: tuple[str, ...] = (),
    knots: Array = NO_KNOTS,
    progress: Progress | None = None,
) -> TorqueTable:
    """Evaluate the inverse dynamics of a motion at times t.

    Args:
        machine, effects: as in `inverse_dynamics`.
        t: (K,) increasing [s].
        derivative: of the motion, times (K,) and order -> (K, n).
        smoothness: highest order whose derivative is continuous.
        values: of the parameters that stay symbols, by name; those not given have their nominal value.
        covariance: of q, v, a.
        limits: one Envelope for each drive, or none.
        notes: sentences about the motion.
        knots: times at which a derivative of the motion jumps [s].
        progress: called with the points done and their total number.

    Raises:
        TypeError, ValueError: as `inverse_dynamics`; sizes that disagree; a parameter that is not there; a number that
            is not finite.
    """
    function = inverse_dynamics(machine, effects)
    n = len(machine.coordinates)
    with np.errstate(all="ignore"):  # overflows are refused below
        parts = tuple(derivative(t, order) for order in range(3))
    if parts[0].shape[1] != n:
        names = ", ".join(c.name for c in machine.coordinates)
        raise ValueError(f"the motion has {parts[0].shape[1]} coordinates, {machine.name} has {n} ({names})")
    checks.instance("limits", limits, tuple | list, "one Envelope for each drive, or none")
    for limit in limits:
        checks.instance("limits, each", limit, Envelope, "an Envelope")
    if progress is not None and (isinstance(progress, type) or not callable(progress)):
        raise TypeError(f"progress: got {checks.shown(progress)}, expected a function of points done and total")
    if limits and len(limits) != n:
        raise ValueError(f"limits: {len(limits)} envelopes, {machine.name} has {n} drives")
    parameters = parameter_values(machine, effects, {} if values is None else values)
    (tau,) = evaluate(function, *parts, parameters, *time_column(function, t), progress=progress)
    q, v, a = parts
    for symbol, part in (("q", q), ("v", v), ("a", a), ("tau", tau)):
        check_finite(symbol, part, t, machine)
    return TorqueTable(
        t,
        q,
        v,
        a,
        tau,
        machine,
        tuple(effects),
        parameters,
        derivative,
        smoothness,
        covariance,
        tuple(limits),
        notes,
        knots,
    )


def check_finite(symbol: str, values: Array, t: Array, machine: Manipulator) -> None:
    """Raise ValueError with name and time for a number that is not finite."""
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        k, i = bad[0]
        raise ValueError(
            f"{symbol}_{machine.coordinates[i].name} is {values[k, i]} at {t[k]:.9g} s: a derivative of the motion, a "
            "speed or a parameter is too large for double precision, or the motion is not defined there"
        )


def parameter_values(machine: Manipulator, effects: Sequence[Effect], values: dict[str, float]) -> Array:
    """Return the values of the parameters that stay symbols, in the order of p of the inverse dynamics."""
    checks.mapping("values", values, "a dict parameter name -> number, or None")
    mechanics = assemble(machine, effects)
    nominal = {**{name: machine.nominal[name] for name in machine.symbols}, **mechanics.terms.nominal}
    for name in values:
        if name not in nominal:
            raise ValueError(f"no parameter {name!r} that stays a symbol; there is {', '.join(nominal) or 'none'}")
    results = {**nominal, **values}
    return np.array([checks.number(f"parameter {name!r}", results[name]) for name in mechanics.parameters])
