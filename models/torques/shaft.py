"""Torque, speed and power at the shafts of the motors, before the gears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.contributions import values_of
from models.mechanics.terms import Effect
from ocp.checks import Array

RPM = 30.0 / np.pi  # revolutions per minute in one rad/s
MOVING = 1e-3  # share of the largest speed above which a shaft moves


@dataclass(frozen=True, eq=False)
class Shaft:
    """Quantities at the shafts of the motors, one row for each time, NaN for a drive without a gear ratio."""

    ratio: Array  # (n,) motor speed over joint speed [rad/rad or rad/m]
    torque: Array  # (K, n) [N m]
    speed: Array  # (K, n) [rad/s]

    @property
    def rpm(self) -> Array:
        """(K, n) speed in revolutions per minute."""
        return np.asarray(self.speed * RPM)

    @property
    def power(self) -> Array:
        """(K, n) mechanical power of the motors [W]."""
        return np.asarray(self.torque * self.speed)


def gear_ratios(machine: Manipulator, effects: Sequence[Effect]) -> Array | None:
    """Return the gear ratio of every drive (n,), of the first effect that has one; None if none has.

    Raises:
        ValueError: two effects have different ratios for the same drive.
    """
    ratios: Array | None = None
    for effect in effects:
        if not hasattr(effect, "ratio"):
            continue
        own = values_of(effect, "ratio", machine)
        if len(own) != len(machine.coordinates):
            continue
        if ratios is not None and np.any(np.abs(own - ratios) > 1e-9 * np.abs(ratios)):
            raise ValueError(
                f"the effects have different gear ratios for the same drive ({_row(ratios)} and {_row(own)}); give "
                "motor and rotor of a drive the same ratio"
            )
        ratios = own if ratios is None else np.where(np.isnan(ratios), own, ratios)
    return ratios


def shafts(ratio: Array, motor_v: Array, motor_tau: Array) -> Shaft:
    """Return the quantities at the shafts of motors.

    torque = motor_tau / N,  speed = N motor_v

    Args:
        ratio: (n,) N [rad/rad or rad/m].
        motor_v, motor_tau: (K, n) of the motors, in units of the joints.
    """
    return Shaft(ratio, motor_tau / ratio, motor_v * ratio)


def _row(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values)


def moving_share(t: Array, speed: Array) -> Array:
    """Return the share of the time (n,) in which shafts move: the duty factor of a cycle that is repeated.

    A shaft moves above a thousandth of its largest speed.

    Args:
        t: (K,) increasing [s].
        speed: (K, n) [rad/s].
    """
    moving = np.abs(speed) > MOVING * np.max(np.abs(speed), axis=0)
    return np.asarray(np.diff(t) @ (moving[:-1] | moving[1:]) / (t[-1] - t[0]))


def cubic_mean(t: Array, torque: Array, speed: Array) -> Array:
    """Return the mean torque (n,) by which makers of gears rate the life of their bearings, 0 for a gear at rest.

    (integral |n| |T|^3 dt / integral |n| dt)^(1/3)

    Args:
        t: (K,) increasing [s].
        torque: (K, n) [N m].
        speed: (K, n) n [rad/s].

    Source: ISO 281, Rolling bearings, dynamic load ratings and rating life (exponent 3 of ball bearings).
    """
    turned = np.trapezoid(np.abs(speed), t, axis=0)
    weighted = np.trapezoid(np.abs(speed) * np.abs(torque) ** 3, t, axis=0)
    return np.asarray(np.cbrt(weighted / np.where(turned > 0.0, turned, 1.0)))
