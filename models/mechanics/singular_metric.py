"""Singular metrics and frames: refused if singular everywhere, listed in the System if at some configurations."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import casadi as ca
import numpy as np

from models.machines.factorisation import factorise
from models.machines.frames import Frame
from models.machines.manipulator import Manipulator
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.system import Singularity

SAMPLES = 12
# A pivot of the metric below this multiple of its largest sampled value is zero: the square of a distance of 1e-12.
TINY = 1e-24
# A det F below this multiple of its largest sampled value loses more than six of sixteen digits.
NEAR = 1e-6
LOST = 1e-8  # relative error of det g in a frame that is refused: half the digits
MOST = 1024  # poses of all combinations, sampled beyond
POSES = 128  # sampled for machines of links
LINKS = 1e-13  # a pivot below this multiple of its largest sampled value is a rounding error of the recursion
TURNS = (0.0, np.pi / 2, np.pi, -np.pi / 2)  # poses at which machines are singular, if they are [rad]
LENGTHS = (0.0, 0.7)  # [m]


def singularities(
    machine: Manipulator, frame: Frame, regular: Frame, nominal: Mapping[str, float]
) -> tuple[Singularity, ...]:
    """Return the configurations at which the metric of a machine with its effects, or a frame, is singular.

    The metric is singular where a pivot of g' = L D L' in the regular frame vanishes, a frame where det F does.

    Args:
        machine: with the names of the parameters that give each coordinate its inertia.
        frame: in which the equations are written.
        regular: a frame that exists wherever the metric is regular.
        nominal: values of the parameters that stay symbols.

    Raises:
        ValueError: the metric or the frame is singular at every configuration, or the frame loses half the digits.
    """
    q, p = machine.q, ca.vertcat(*_parameters(machine, frame, regular))
    p_values = np.array([nominal[str(symbol)] for symbol in ca.vertsplit(p)] if p.numel() else [])
    inertia, own = factorise(regular.metric).pivots, factorise(frame.metric).pivots
    determinant, determinant_regular = ca.det(ca.densify(frame.matrix)), ca.det(ca.densify(regular.matrix))
    outputs = [inertia, own, determinant, determinant_regular]
    function = ca.Function("determinants", [q, p], [ca.densify(output) for output in outputs])

    def at(poses: Array) -> list[Array]:
        values = function.map(len(poses))(poses.T, np.tile(p_values[:, None], len(poses)))
        return [np.array(value).T for value in values]

    usual = np.random.default_rng(20260101).uniform(0.3, 1.7, (SAMPLES, q.numel()))
    pivots, theirs, determinants, determinants_regular = at(usual)
    special = at(_special(machine, ca.vertcat(inertia, own, determinant)))
    pivots_special, determinants_special = special[0], special[2]
    results = []
    for i in range(q.numel()):
        entry, scale = inertia[i], float(np.max(np.nan_to_num(pivots[:, i], nan=0.0)))
        if not scale > 0.0 and not ca.depends_on(entry, p):
            raise ValueError(f"{_without_inertia(machine, i)} at any position; {_cure(machine, i)}")
        here = pivots_special[:, i]
        if not np.all(here > TINY * scale) or ca.depends_on(entry, p):
            words = f"{_without_inertia(machine, i)} at some positions; {_cure(machine, i)}, or keep away"
            results.append(Singularity(entry, TINY * scale, words))
    words = (
        f"the frame {frame.name!r} of the {machine.name} manipulator is singular where {frame.vanishes or 'det F'} "
        "is 0; use frame='regular'"
    )
    scale = float(np.max(np.abs(np.nan_to_num(determinants, nan=0.0))))
    moves = np.ptp(determinants_special) > NEAR * scale or not np.all(np.isfinite(determinants_special))
    if moves or ca.depends_on(determinant, p):
        results.append(Singularity(determinant, NEAR * scale if moves else 0.0, words, crossed=bool(moves)))
    if not moves and frame is not regular:
        everywhere = [
            np.vstack(pair) for pair in zip((pivots, theirs, determinants, determinants_regular), special, strict=True)
        ]
        _check_digits(machine, frame, *everywhere)
    return tuple(results)


def vanishing_inertia(machine: Manipulator, pivots: ca.SX, nominal: Mapping[str, float]) -> tuple[Singularity, ...]:
    """Return the configurations at which a pivot of the metric of a machine of links vanishes.

    A bounded number of poses is sampled, whatever the number of joints.

    Args:
        machine: whose coordinates.
        pivots: (n,) diagonal of D in M = L D L'.
        nominal: values of the parameters that stay symbols.

    Raises:
        ValueError: a pivot vanishes, or is negative, at every sampled pose.
    """
    q = machine.q
    own = {symbol.element_hash() for symbol in ca.vertsplit(q)}
    symbols = [symbol for symbol in ca.symvar(pivots) if symbol.element_hash() not in own]
    p = ca.vertcat(*symbols) if symbols else ca.SX(0, 1)
    values = np.array([nominal[str(symbol)] for symbol in symbols])
    function = ca.Function("pivots", [q, p], [ca.densify(pivots)])
    sampled = evaluate(function, _poses(machine), np.tile(values, (POSES, 1)))[0]
    results = []
    for i in range(q.numel()):
        entry, scale = pivots[i], float(np.max(np.nan_to_num(sampled[:, i], nan=0.0)))
        if not scale > 0.0:
            raise ValueError(f"{_without_inertia(machine, i)} at any position; {_cure(machine, i)}")
        if not np.all(sampled[:, i] > LINKS * scale) or ca.depends_on(entry, p):
            words = f"{_without_inertia(machine, i)} at some positions; {_cure(machine, i)}, or keep away"
            results.append(Singularity(entry, LINKS * scale, words))
    return tuple(results)


def _poses(machine: Manipulator) -> Array:
    """Return poses (POSES, n): half of them with coordinates at which arms are singular, half at random."""
    generator = np.random.default_rng(20260101)
    angular = np.array([coordinate.unit == "rad" for coordinate in machine.coordinates])
    shape = (POSES // 2, len(angular))
    special = np.where(angular, generator.choice(TURNS, shape), generator.choice(LENGTHS, shape))
    special[0] = 0.0
    free = np.where(angular, generator.uniform(-np.pi, np.pi, shape), generator.uniform(-0.7, 0.7, shape))
    return np.vstack([special, free])


def _check_digits(
    machine: Manipulator, frame: Frame, pivots: Array, own: Array, determinant: Array, determinant_regular: Array
) -> None:
    """Refuse a frame in which det g = det g' det(F)^2 is not what it is in the regular frame."""
    good = np.all(pivots > TINY * np.max(np.nan_to_num(pivots), axis=0), axis=1)
    if not np.any(good):
        return
    with np.errstate(all="ignore"):
        ratio = (
            np.sum(np.log(own) - np.log(pivots), axis=1) + 2.0 * np.log(np.abs(determinant / determinant_regular))[:, 0]
        )
    worst = np.max(np.abs(ratio[good]))
    if not worst <= LOST:
        left = "no" if not worst < 0.1 else f"{-np.log10(worst):.0f}"
        raise ValueError(
            f"{machine.name}: the frame {frame.name!r} keeps {left} of sixteen digits of det g for these parameters; "
            "use frame='regular', which keeps them"
        )


def _parameters(machine: Manipulator, *frames: Frame) -> list[ca.SX]:
    own = {symbol.element_hash() for symbol in ca.vertsplit(machine.q)}
    every = ca.symvar(ca.vertcat(*(ca.vec(part) for f in frames for part in (f.metric, f.matrix))))
    return [symbol for symbol in every if symbol.element_hash() not in own]


def _special(machine: Manipulator, expression: ca.SX) -> Array:
    """Return poses (K, n): all combinations of the values at which arms are singular, for coordinates that matter."""
    rows = []
    for coordinate, symbol in zip(machine.coordinates, ca.vertsplit(machine.q), strict=True):
        values = TURNS if coordinate.unit == "rad" else LENGTHS
        rows.append(values if ca.depends_on(expression, symbol) else (0.6,))
    if np.prod([len(values) for values in rows]) > MOST:  # a bounded number of poses, whatever the number of joints
        return np.column_stack([np.random.default_rng(20260101).choice(values, MOST) for values in rows])
    return np.array(list(product(*rows)))


def _without_inertia(machine: Manipulator, i: int) -> str:
    return f"the {machine.name} manipulator has a singular metric, no inertia about {machine.coordinates[i].name}"


def _cure(machine: Manipulator, i: int) -> str:
    name = machine.coordinates[i].name
    needs = machine.inertia.get(name, "the bodies beyond it")
    return f"give {needs} a value > 0 or add an effect with inertia such as RotorInertia"
