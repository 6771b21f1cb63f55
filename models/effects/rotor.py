"""Inertia of the rotors of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from models.effects.effect_fields import Each, quantity, read_fields
from models.machines.manipulator import Manipulator
from models.mechanics.contributions import ROTOR, Sizes
from models.mechanics.terms import Terms
from ocp import checks


@dataclass(frozen=True)
class RotorInertia:
    """Rotors that turn with the joints through gears, T = 1/2 sum_k J_k W_k^2 with W = N C v.

    Reflected to the joints that is the metric (N C)' J (N C): diag(N_k^2 J_k) without coupling. The rotation of the
    rotors with the links that carry them is neglected, which is right to 1 / N; their mass belongs to the links.

    Adds a metric; no states, no controls, the parameters `rotor_inertia.inertia`, `rotor_inertia.ratio`
    (`..._1` ...) if they are Parameters.

    Args:
        inertia: J of every rotor about its axis >= 0, one for all drives or one for each (None: none) [kg m^2].
        ratio: N, rotor speed over joint speed; rad of the rotor for a rad or for a metre of the joint [rad/rad or
            rad/m].
        coupling: (n, n) matrix C, numbers, by which gears drive several joints; None is none (the identity) [1].

    Raises:
        ValueError: a value is no finite number in its range, or the coupling is no finite square matrix.

    Source: M. W. Spong, Modeling and control of elastic joint robots, ASME J. Dyn. Syst. Meas. Control 109 (1987),
        assumption A2.
    """

    inertia: Each = quantity("kg m^2", at_least=0.0)
    ratio: Each = quantity("rad/rad or rad/m", 100.0)
    coupling: Sequence[Sequence[float]] | None = field(default=None, metadata={"unit": "rad/rad or m/m"})

    def __post_init__(self) -> None:
        read_fields(self, "inertia", "ratio")
        if self.coupling is not None:
            wanted = "a square matrix of numbers"
            matrix = checks.numbers("rotor_inertia.coupling", self.coupling, wanted)
            if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
                raise checks.refused("rotor_inertia.coupling", self.coupling, wanted)

    @classmethod
    def typical(cls, sizes: Sizes) -> RotorInertia:
        """Return rotors of 1e-4 kg m^2 with gears of 100 (300 rad/m)."""
        return cls(ROTOR, sizes.ratio)

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the metric."""
        fields, n = read_fields(self, "inertia", "ratio"), machine.q.numel()
        coupling = np.eye(n) if self.coupling is None else np.array(self.coupling, dtype=float)
        if coupling.shape != (n, n):
            raise ValueError(
                f"rotor_inertia.coupling: got a matrix of shape {coupling.shape}, {machine.name} has {n} drives"
            )
        reflected = [
            0.0 if inertia is None or ratio is None else ratio * ratio * inertia
            for inertia, ratio in zip(fields.each("inertia", machine), fields.each("ratio", machine), strict=True)
        ]
        gears = ca.sparsify(ca.SX(ca.DM(coupling)))
        metric = gears.T @ ca.sparsify(ca.diag(ca.vertcat(*map(ca.SX, reflected)))) @ gears
        return Terms(
            metric=ca.sparsify(metric), symbols=fields.symbols, nominal=fields.nominal,
            defines={"rotors": fields.prefix},
        )  # fmt: skip
