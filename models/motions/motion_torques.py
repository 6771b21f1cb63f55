"""Torque table of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from models.machines.manipulator import Manipulator
from models.mechanics.terms import Effect
from models.motions.plausibility import implausible
from models.motions.smoothing import Smoothed
from models.torques.drive_loads import Envelope
from models.torques.torque_table import TorqueTable, tabulate
from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import Progress


class Given(Protocol):
    """A motion, as far as its torques need it; see `Motion`."""

    times: Array
    smoothness: float
    smoothed: Smoothed | None
    notes: tuple[str, ...]
    stated: bool

    @property
    def knots(self) -> Array:
        """Times at which a derivative jumps [s]."""

    def derivative(self, t: Array | float, order: int) -> Array:
        """Return d^order q / dt^order (K, n) at times t [s]."""


def torques_of(
    motion: Given,
    machine: Manipulator,
    effects: Sequence[Effect],
    times: object,
    values: dict[str, float] | None,
    limits: Sequence[Envelope],
    progress: Progress | None,
) -> TorqueTable:
    """Return the torques of a motion by inverse dynamics; see `Motion.torques`.

    Args:
        motion: q(t).
        machine, effects: as in `inverse_dynamics`.
        times: (K,) increasing [s], or None for those of the motion.
        values, limits, progress: of `tabulate`.

    Raises:
        TypeError, ValueError: as `tabulate`; positions, speeds or torques far beyond those of the machine, if the
            source of the motion does not state units.
    """
    chosen = checks.numbers("times", motion.times if times is None else times)
    if chosen.ndim != 1 or len(chosen) < 2 or not np.all(np.diff(chosen) > 0.0):
        raise checks.refused("times", times, "at least two increasing times")
    covariance = None if motion.smoothed is None else motion.smoothed.covariance
    table = tabulate(
        machine, effects, chosen, motion.derivative, smoothness=motion.smoothness, covariance=covariance,
        notes=motion.notes, knots=motion.knots, values=values, limits=limits, progress=progress,
    )  # fmt: skip
    doubts = implausible(table)
    if doubts and not motion.stated:
        raise ValueError(f"{doubts[0]} If the motion is meant like this, state the units of its coordinates")
    return replace(table, notes=(*table.notes, *doubts)) if doubts else table
