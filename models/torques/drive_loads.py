"""What a motion asks of each drive, and the limits of a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp import checks
from ocp.checks import Array

# A limit counts as exceeded beyond this share of it.
SLACK = 1e-9


@dataclass(frozen=True)
class Envelope:
    """Limits of a drive in the torque-speed plane.

    |tau| <= peak up to the corner speed, from there on a straight line to zero at the no-load speed; the root mean
    square stays below `continuous`; |tau v| <= power.

    Args:
        peak: largest torque or force [N m or N].
        speed: no-load speed, at which no torque is left [rad/s or m/s].
        corner: speed up to which the peak torque is available; None: up to `speed` [rad/s or m/s].
        continuous: torque or force that the drive bears for ever [N m or N].
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
    """An interval in which a drive is asked for more than it has."""

    start: float  # [s]
    end: float
    ratio: float  # largest |tau| over the torque available; inf beyond the no-load speed


@dataclass(frozen=True)
class DriveLoad:
    """What a motion asks of one drive; torques along +q of its coordinate."""

    name: str
    unit: str  # of the torque or force
    peak: float  # largest magnitude, with its sign [unit]
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


def drive_load(name: str, unit: str, t: Array, v: Array, tau: Array, limit: Envelope | None) -> DriveLoad:
    """Return the load of one drive from samples (K,) of its motion; integrals by the trapezoidal rule.

    Args:
        name, unit: of the torque.
        t: increasing times [s].
        v: velocities [rad/s or m/s].
        tau: torques [N m] or forces [N].
        limit: of the drive, or None.
    """
    step, span = np.diff(t), float(t[-1] - t[0])
    power = tau * v
    motor, brake = positive_part(step, power), 0.0 - positive_part(step, -power)
    # A piece on which tau is linear has this mean square exactly.
    squares = float(np.sum(step * (tau[:-1] ** 2 + tau[:-1] * tau[1:] + tau[1:] ** 2) / 3.0))
    rms = np.sqrt(squares / span)
    top = int(np.argmax(np.abs(tau)))
    return DriveLoad(
        name, unit, float(tau[top]), float(t[top]), float(rms), float(np.max(np.abs(v))), (motor + brake) / span,
        max(float(power.max()), 0.0), min(float(power.min()), 0.0), motor, brake,
        exceeded(t, v, tau, limit) if limit is not None else (),
        limit is not None and bool(rms > limit.continuous * (1.0 + SLACK)),
    )  # fmt: skip


def positive_part(step: Array, power: Array) -> float:
    """Return the integral of max(P, 0) of samples joined by straight lines."""
    first, last = power[:-1], power[1:]
    high, low = np.maximum(first, last), np.minimum(first, last)
    crossing = (high > 0.0) & (low < 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        area = np.where(crossing, high**2 / (high - low) / 2.0, np.maximum(first + last, 0.0) / 2.0)
    return float(np.sum(step * area))


def exceeded(t: Array, v: Array, tau: Array, limit: Envelope) -> tuple[Exceeded, ...]:
    """Return the intervals in which |tau| is beyond what the drive has at that speed."""
    allowed = limit.torque(v)
    over = np.abs(tau) > allowed * (1.0 + SLACK)
    over |= np.abs(v) > limit.speed * (1.0 + SLACK)
    results = []
    for first, after in runs(over):
        part = slice(first, after)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(tau[part]) / allowed[part]
        worst = float(np.max(np.where(np.isnan(ratio), np.inf, ratio)))
        results.append(Exceeded(float(t[first]), float(t[after - 1]), worst))
    return tuple(results)


def runs(flags: Array) -> list[tuple[int, int]]:
    """Return the first place of every run of True in flags (K,), and the place after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(after)) for first, after in edges.reshape(-1, 2)]
