"""Inertia of the rotors of the drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from models.effects.effect_fields import Each, Fields, Some, quantity, read_fields
from models.machines.manipulator import Manipulator
from models.machines.segments import chain_of
from models.mechanics.contributions import ROTOR, Sizes
from models.mechanics.terms import Terms
from ocp import checks


@dataclass(frozen=True)
class RotorInertia:
    """Rotors that turn with the joints through gears, T = 1/2 sum_k J_k W_k^2 with W = N C v.

    Reflected to the joints that is the metric (N C)' J (N C): diag(N_k^2 J_k) without coupling. Unless they are
    `carried`, the rotation of the rotors with the links that carry them is neglected, which is right to 1 / N; their
    mass, and their inertia while they do not turn, belong to the links. Rotors that joints of an arm have themselves,
    such as those of robots.puma560(), are in its metric already; these come on top of them.

    Adds a metric; no states, no controls, the parameters `rotor_inertia.inertia`, `rotor_inertia.ratio`
    (`..._1` ...) if they are Parameters.

    Args:
        inertia: J of every rotor about its axis >= 0, one for all drives or one for each (None: none) [kg m^2].
        ratio: N, rotor speed over joint speed; rad of the rotor for a rad or for a metre of the joint [rad/rad or
            rad/m].
        coupling: (n, n) matrix C, numbers, by which gears drive several joints; None is none (the identity) [1].
        carried: whether a rotor, parallel to the axis of its joint, turns with the link before as well, one for all
            drives or one for each; this adds N J (axis . omega) v with the angular velocity omega of that link.

    Raises:
        ValueError: a value is no finite number in its range, the coupling is no finite square matrix, or given together
            with `carried`.

    Source: M. W. Spong, Modeling and control of elastic joint robots, ASME J. Dyn. Syst. Meas. Control 109 (1987),
        assumption A2.
    """

    inertia: Some = quantity("kg m^2", at_least=0.0)
    ratio: Each = quantity("rad/rad or rad/m", 100.0)
    coupling: Sequence[Sequence[float]] | None = field(default=None, metadata={"unit": "rad/rad or m/m"})
    carried: bool | Sequence[bool] = False

    def __post_init__(self) -> None:
        read_fields(self, "inertia", "ratio")
        if self.coupling is not None:
            wanted = "a square matrix of numbers"
            matrix = checks.numbers("rotor_inertia.coupling", self.coupling, wanted)
            if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
                raise checks.refused("rotor_inertia.coupling", self.coupling, wanted)
        if isinstance(self.carried, list | tuple) and not self.carried:
            raise checks.refused("rotor_inertia.carried", self.carried, "True or False, one for all drives or for each")
        for one in self.carried if isinstance(self.carried, list | tuple) else (self.carried,):
            checks.truth("rotor_inertia.carried", one)
        if self.carried and self.coupling is not None:
            raise ValueError("rotor_inertia.carried: given together with a coupling; give one of them")

    @classmethod
    def typical(cls, sizes: Sizes) -> RotorInertia:
        """Return rotors of 1e-4 kg m^2 with gears of 100 (300 rad/m) on the joints that have none of their own."""
        own = sizes.machine.rotors or (0.0,) * len(sizes.ratio)
        free = [isinstance(rotor, float) and rotor == 0.0 for rotor in own]
        return cls(ROTOR if all(free) else tuple(ROTOR if one else None for one in free), sizes.ratio)

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
        own = Terms(symbols=fields.symbols, nominal=fields.nominal, defines={"rotors": fields.prefix})
        spins = self._spins(fields, machine)
        if spins is not None and machine.recursion is None:
            chain = chain_of(machine)
            if chain is None:
                raise ValueError(f"rotor_inertia.carried: {machine.name} does not say which link carries which joint")
            turning = chain.turning([c.name for c in machine.coordinates], machine.q)
            pull = ca.sparsify(ca.diag(spins)) @ turning
            metric = metric + pull + pull.T
        return own + Terms(metric=ca.sparsify(metric), spins=spins)

    def _spins(self, fields: Fields, machine: Manipulator) -> ca.SX | None:
        """Return N J (n,) of the rotors that links carry; None if there are none."""
        n = machine.q.numel()
        carried = tuple(self.carried) if isinstance(self.carried, list | tuple) else (self.carried,) * n
        if len(carried) != n:
            raise ValueError(f"rotor_inertia.carried: got {len(carried)} values, {machine.name} has {n} drives")
        pairs = zip(carried, fields.each("inertia", machine), fields.each("ratio", machine), strict=True)
        entries = [ratio * inertia if one and inertia is not None and ratio is not None else 0.0
                   for one, inertia, ratio in pairs]  # fmt: skip
        return ca.sparsify(ca.vertcat(*map(ca.SX, entries))) if any(carried) else None
