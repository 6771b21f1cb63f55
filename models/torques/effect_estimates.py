"""Estimated contribution of every effect to a solved motion: of those that are on, and of those left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

import models.effects
from models.machines.manipulator import Manipulator
from models.mechanics.contributions import Contribution, Sizes, SolvedMotion
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect, Terms, name_of
from models.torques.torque_functions import inverse_dynamics, recover
from ocp import checks
from ocp.checks import Array
from ocp.system import System

POINTS = np.linspace(0.0, 1.0, 9)  # of each element of the solution, at which its torques are evaluated
MOTION = ("q", "v", "tau", "motor_q", "motor_v", "motor_tau")  # signals that a rigid drive has along a motion


class Solved(Protocol):
    """A solution of an optimal-control problem, as far as estimates need it."""

    @property
    def values(self) -> Mapping[str, float]:
        """Parameter values by name."""

    def samples(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """Return t (K,), x (K, nx), dx/dt (K, nx), u (K, nu) at points tau of every element."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Contribution of one effect to the torque of each drive along a motion."""

    name: str
    on: bool  # whether the motion was solved with it
    effect: Effect
    peak: Array  # (n,) largest torque that it adds or takes [N m or N]
    rms: Array  # (n,) root mean square of that torque over the motion [N m or N]
    share: Array  # (n,) peak over the largest torque of each drive in the motion
    use: float  # largest share of its limit that the motion uses; NaN if it is no limit
    note: str

    def __str__(self) -> str:
        shares = " ".join(f"{100.0 * value:7.2f}" for value in self.share)
        use = "" if np.isnan(self.use) else f"  uses {100.0 * self.use:.0f} % of the limit"
        return f"{self.name:16s} {'on ' if self.on else 'off'} {shares} % of peak torque{use}  {self.note}".rstrip()


def estimate(
    system: System,
    machine: Manipulator,
    effects: Sequence[Effect],
    solution: Solved,
    candidates: Sequence[Effect] | None = None,
) -> tuple[Estimate, ...]:
    """Estimate the torque that every effect contributes to a solved motion, whether it was solved with it or not.

    Along q(t) of the solution, without solving again. Effects on the joints (gravity, loads, friction, rotors, tool
    forces): tau with the effect less tau without it, by inverse dynamics; exact for this motion. Effects with nothing
    but limits: the largest share of the limit. Drives and windings bring their own estimate, as any effect may by a
    method `contribution` (see `models.mechanics.contributions`). An effect that is off is added to those that are on,
    one at a time.

    Args:
        system: a form of the machine with these effects, that of the solution.
        machine: the machine.
        effects: those that are on.
        solution: of a problem on the system.
        candidates: effects that are off; None for `typical` ones of every family that is not on.

    Returns:
        First those that are on, then those that are off, in the order of their largest share.

    Raises:
        TypeError, ValueError: as `inverse_dynamics`.
    """
    _check(system, solution, candidates)
    t, x, rate, _ = solution.samples(POINTS)
    values = dict(solution.values)
    p = np.array([values.get(name, value) for name, value in system.nominal.items()])[:, None]
    result = recover(system, machine, effects).map(len(t))(x.T, rate.T, np.tile(p, len(t)))
    q, v, a, tau = (np.array(part) for part in result)
    motion, sizes = SolvedMotion(t, q, v, a, tau, values), Sizes.of(machine, tau, v)
    off = list(candidates) if candidates is not None else _missing(sizes, effects)
    everything = (*effects, *off)
    rows = []
    for on, listed in ((True, effects), (False, off)):
        judged = []
        for effect in listed:
            others = [other for other in effects if other is not effect] if on else list(effects)
            part = _contribution(sizes, others, effect, everything, motion)
            judged.append(_estimate(effect, on, part, motion))
        rows += sorted(judged, key=lambda row: -float(np.max(np.nan_to_num(row.share))))
    return tuple(rows)


def typical(machine: Manipulator, tau: Array, v: Array) -> tuple[Effect, ...]:
    """Return the effects of `models.effects` with parameters of the usual size for a motion.

    The sizes are those of the class method `typical` of each effect. Stops and counterbalances have none: they depend
    on the build of the machine.

    Args:
        machine: whose drives the effects are for.
        tau: (n, K) torques of the motion [N m or N].
        v: (n, K) velocities [rad/s or m/s].
    """
    return _typical(Sizes.of(machine, tau, v))


def _typical(sizes: Sizes) -> tuple[Effect, ...]:
    kinds = [getattr(models.effects, name) for name in models.effects.__all__]
    return tuple(kind.typical(sizes) for kind in kinds if hasattr(kind, "typical"))


def _missing(sizes: Sizes, effects: Sequence[Effect]) -> list[Effect]:
    """Return typical effects that are not on, without those that define only what an effect that is on defines."""
    present: set[str] = set().union(*(effect(sizes.machine, Terms()).defines for effect in effects))
    kinds = {type(effect) for effect in effects}
    missing = []
    for effect in _typical(sizes):
        defines = set(effect(sizes.machine, Terms()).defines)
        if type(effect) not in kinds and not (defines and defines <= present):
            missing.append(effect)
    return missing


def _contribution(
    sizes: Sizes, others: Sequence[Effect], effect: Effect, everything: Sequence[Effect], motion: SolvedMotion
) -> Contribution:
    """Return the contribution of one effect to a motion with the other effects."""
    own = getattr(effect, "contribution", None)
    if own is not None:
        result: Contribution = own(sizes, motion, everything)
        return result
    terms = effect(sizes.machine, Terms())
    if terms.limits and not _acts_on_joints(terms):
        return Contribution(np.zeros_like(motion.tau), _limit_use(sizes.machine, terms, motion))
    rest = [other for other in others if _acts_on_joints(other(sizes.machine, Terms()))]
    return Contribution(_torque(sizes.machine, [*rest, effect], motion) - _torque(sizes.machine, rest, motion))


def _estimate(effect: Effect, on: bool, part: Contribution, motion: SolvedMotion) -> Estimate:
    peak = np.max(np.abs(part.torque), axis=1)
    largest = np.maximum(np.max(np.abs(motion.tau), axis=1), 1e-300)
    return Estimate(name_of(effect), on, effect, peak, motion.rms(part.torque), peak / largest, part.use, part.note)


def _acts_on_joints(terms: Terms) -> bool:
    """Whether an effect adds inertia, a field or a force, and is no drive."""
    drives = terms.source is not None or terms.transmission is not None
    parts = (terms.metric, terms.acceleration, terms.force)
    return not drives and (any(part is not None for part in parts) or bool(terms.bodies) or _is_used(terms.potential))


def _is_used(potential: ca.SX) -> bool:
    return not (potential.is_constant() and potential.is_zero())


def _torque(machine: Manipulator, effects: Sequence[Effect], motion: SolvedMotion) -> Array:
    function, mechanics = inverse_dynamics(machine, effects), assemble(machine, effects)
    nominal = {**machine.nominal, **mechanics.terms.nominal}
    p = np.array([[motion.values.get(name, nominal[name])] for name in mechanics.parameters]).reshape(-1, 1)
    inputs = [motion.q, motion.v, motion.a, np.tile(p, len(motion.t))]
    if function.n_in() == 5:
        inputs.append(motion.t[None, :])
    return np.array(function.map(len(motion.t))(*inputs))


def _limit_use(machine: Manipulator, terms: Terms, motion: SolvedMotion) -> float:
    """Return the largest share of the limits of an effect, NaN if they depend on more than q, v and tau."""
    if any(read.name not in MOTION for read in terms.reads):
        return float("nan")
    known = {"q": motion.q, "v": motion.v, "tau": motion.tau}
    reads = [(read.symbol, known[read.name.removeprefix("motor_")]) for read in terms.reads]
    names = list(terms.symbols)
    p = np.array([motion.values.get(name, terms.nominal[name]) for name in names]).reshape(-1, 1)
    symbols = [symbol for symbol, _ in reads] + [ca.vertcat(*terms.symbols.values())]
    numbers = [column for _, column in reads] + [np.tile(p, len(motion.t))]
    symbols += [machine.q, machine.v]
    numbers += [motion.q, motion.v]
    used = 0.0
    for name, (lower, upper) in terms.limits.items():
        function = ca.Function("signal", symbols, [ca.densify(terms.signals[name].expression)])
        signal = np.array(function.map(len(motion.t))(*numbers))
        for sign, side in ((-1.0, lower), (1.0, upper)):
            if side is not None and np.all(np.asarray(side) != 0.0):  # a bound of zero has no share
                used = max(used, float(np.max(sign * signal / np.abs(np.broadcast_to(side, len(signal)))[:, None])))
    return used


def _check(system: System, solution: Solved, candidates: Sequence[Effect] | None) -> None:
    checks.instance("system", system, System, "a System, a form of the machine")
    if isinstance(solution, type) or not (hasattr(solution, "values") and hasattr(solution, "samples")):
        raise TypeError(f"solution: got {checks.shown(solution)}, expected a Solution")
    if candidates is not None:
        checks.instance("candidates", candidates, list | tuple, "a list of effects, or None")
        for candidate in candidates:
            if isinstance(candidate, type) or not callable(candidate):
                raise TypeError(f"candidates: got {checks.shown(candidate)}, expected an effect such as Gravity()")
