"""Loads of the drives along a motion (peaks, root mean squares, energies), and the limits of a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.torques.time_means import crossings, positive_part, rms
from ocp import checks
from ocp.checks import Array

# A limit counts as exceeded from this share beyond it on: drives are not known better, and an optimal motion, which
# keeps its limits at the nodes of its grid, exceeds them by less between them.
SLACK = 1e-3


@dataclass(frozen=True)
class Envelope:
    """Limits of a drive in the torque-speed plane.

    |tau| <= peak up to the corner speed, from there on a straight line to zero at the no-load speed; the root mean
    square stays below `continuous`; |tau v| <= power.

    Args:
        peak: largest torque or force [N m or N].
        speed: no-load speed, at which no torque is left [rad/s or m/s].
        corner: speed up to which the peak torque is available; None: up to `speed` [rad/s or m/s].
        continuous: torque or force that the drive delivers for any time without overheating [N m or N].
        power: [W].

    Raises:
        ValueError: a limit that is not > 0, or a corner beyond the no-load speed.
    """

    peak: float = np.inf
    speed: float = np.inf
    corner: float | None = None
    continuous: float = np.inf
    power: float = np.inf

    def __post_init__(self) -> None:
        for name in ("peak", "speed", "corner", "continuous", "power"):
            value = getattr(self, name)
            if value is not None or name != "corner":
                checks.number(f"Envelope: {name}", value, "a number > 0", above=0.0, finite=False)
        if self.corner is not None and not (self.corner <= self.speed < np.inf):
            raise ValueError(
                f"Envelope: corner {self.corner:g} needs a finite no-load speed beyond it, got {self.speed:g}"
            )

    def torque(self, speed: Array) -> Array:
        """Return the largest torque (K,) at speeds (K,) of either sign."""
        size = np.abs(checks.numbers("speed", speed, "numbers", finite=False))
        corner = self.speed if self.corner is None else self.corner
        with np.errstate(invalid="ignore", divide="ignore"):
            falling = self.peak * (self.speed - size) / (self.speed - corner)
            allowed = np.where(size <= corner, self.peak, np.clip(np.nan_to_num(falling, nan=0.0), 0.0, self.peak))
            return np.asarray(np.minimum(allowed, np.where(size > 0.0, self.power / size, np.inf)))


@dataclass(frozen=True)
class Exceeded:
    """An interval in which the motion needs more than the drive can deliver."""

    start: float  # [s]
    end: float
    ratio: float  # largest |tau| over the torque available; inf beyond the no-load speed


@dataclass(frozen=True)
class DriveLoad:
    """Load of one drive along a motion; torques along +q of its coordinate."""

    name: str
    unit: str  # of the torque or force
    peak: float  # torque of the largest absolute value, with its sign [unit]
    peak_time: float  # [s]
    rms: float  # sqrt(1/T integral tau^2 dt) [unit]
    speed: float  # largest |v| [rad/s or m/s]
    mean_power: float  # 1/T integral tau v dt [W]
    peak_power: float  # largest tau v: the drive works as a motor [W]
    peak_braking: float  # smallest tau v: the drive works as a brake; <= 0 [W]
    motor_energy: float  # integral of the positive power [J]
    brake_energy: float  # integral of the negative power, <= 0 [J]
    exceeded: tuple[Exceeded, ...]
    overheated: bool  # the root mean square is beyond the continuous torque


def loads_of(
    names: tuple[str, ...], units: tuple[str, ...], t: Array, v: Array, tau: Array, limits: tuple[Envelope, ...]
) -> tuple[DriveLoad, ...]:
    """Return the loads of n drives from velocities and torques that are linear between the times.

    Args:
        names, units: (n,) of the torques.
        t: (K,) increasing [s].
        v: (K, n) velocities [rad/s or m/s].
        tau: (K, n) torques [N m] or forces [N].
        limits: (n,) of the drives, or none.
    """
    duration, power = float(t[-1] - t[0]), tau * v
    motor, brake = positive_part(t, power), 0.0 - positive_part(t, -power)
    mean_square, top = rms(t, tau), [np.argmax(np.abs(column)) for column in tau.T]
    loads = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        limit, k = limits[i] if limits else None, int(top[i])
        loads.append(DriveLoad(
            name, unit, float(tau[k, i]), float(t[k]), float(mean_square[i]), float(np.max(np.abs(v[:, i]))),
            float(motor[i] + brake[i]) / duration, max(float(power[:, i].max()), 0.0),
            min(float(power[:, i].min()), 0.0), float(motor[i]), float(brake[i]),
            exceeded(t, v[:, i], tau[:, i], limit) if limit is not None else (),
            limit is not None and bool(mean_square[i] > limit.continuous * (1.0 + SLACK)),
        ))  # fmt: skip
    return tuple(loads)


def exceeded(t: Array, v: Array, tau: Array, limit: Envelope) -> tuple[Exceeded, ...]:
    """Return the intervals in which |tau| is beyond the torque available at that speed, or |v| beyond the speed."""
    allowed, size = limit.torque(v), np.abs(tau)
    over = size - allowed * (1.0 + SLACK)
    if np.isfinite(limit.speed):
        with np.errstate(invalid="ignore"):
            beyond = (np.abs(v) - limit.speed * (1.0 + SLACK)) / limit.speed
        # Of the two excesses the larger share decides; both are positive beyond their limit only.
        over = np.where(beyond > 0.0, np.maximum(over, beyond * np.max(size)), over)
    results = []
    for first, after, start, end in crossings(t, over):
        part = slice(first, after)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = size[part] / allowed[part]
        worst = float(np.max(np.where(np.isnan(ratio), np.inf, ratio)))
        results.append(Exceeded(start, end, worst))
    return tuple(results)
