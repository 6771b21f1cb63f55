"""Check of the necessary conditions of optimality for a motion of given structure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ocp.arcs.arc_problems import ArcMotion, ArcProblem
from ocp.arcs.control_limits import sides_of
from ocp.arcs.mixed_limits import aim_of, is_held, pushes_along
from ocp.arcs.state_limit_multipliers import Jump
from ocp.arcs.switching import switching_functions
from ocp.checks import Array
from ocp.numerics.evaluation import mapped
from ocp.problem.constraints import Where
from ocp.solution.solution import Solution
from ocp.solution.structure import Arc, Contact, Kind
from ocp.transcription.schemes.scheme import Scheme

GAP = 1e-7  # accepted cost, share of the whole, that better controls would save to first order
EXCESS = 1e-7  # accepted violation of a state limit, share of its range
BETWEEN = 16  # intervals of each element between whose ends state limits are checked
ROUNDING = 1e-9  # violation of a state limit, share of its range, that counts as zero
RELEASED = 1e-4  # negative multiplier of a state limit, share of the cost per range, that is an error
SIGNIFICANT = 1e-6  # switching function, share of the Hamiltonian, that counts as zero
LEAST = 1e-12  # cost of an interval with a wrong sign, share of the whole, that counts as zero


@dataclass(frozen=True)
class WrongSign:
    """An interval in which a control is at the bound that maximises H instead of minimising it.

    Where a limit of controls and states is met before the other bound, the control is wanted at that limit.
    """

    control: int
    start: float  # [s]
    end: float  # [s]
    gain: float  # cost that a change would save, to first order
    wanted: Kind
    contact: Contact | None = None  # the limit at which the control is wanted

    def cured(self, arc: Arc) -> Arc:
        """Return an arc with the control as it is wanted; what else held the limit there is free."""
        kinds, held = list(arc.kinds), [c for c in arc.held if c.control != self.control]
        kinds[self.control] = self.wanted
        if self.contact is not None:
            for other in [c for c in held if c.limit == self.contact.limit]:
                kinds[other.control] = Kind.INTERIOR if other.control >= 0 else kinds[other.control]
                held.remove(other)
            held.append(self.contact)
        return replace(arc, kinds=tuple(kinds), held=tuple(sorted(held, key=lambda c: (c.limit, c.side))))


@dataclass(frozen=True)
class Crossing:
    """A state limit exceeded where the structure does not expect it."""

    contact: Contact
    start: float  # [s]
    end: float  # [s]
    worst: float  # time of the largest excess [s]
    share: float  # largest excess, share of the range


@dataclass(frozen=True, eq=False)
class Certificate:
    """Violated conditions of optimality; all are empty for an optimal motion of the right structure.

    Args:
        gap: cost that better controls would save to first order, share of the cost.
        signs: intervals with a control at the wrong bound, the worst first.
        crossings: state limits exceeded, the worst first.
        jumps: of costates, with the wrong sign.
        released: (arc, contact) of state limits active along an arc with a multiplier of the wrong sign.
        gains: (N,) part of each element of the gap.
    """

    gap: float
    signs: tuple[WrongSign, ...]
    crossings: tuple[Crossing, ...]
    jumps: tuple[Jump, ...]
    released: tuple[tuple[int, Contact], ...]
    gains: Array

    @property
    def sound(self) -> bool:
        """Whether all conditions hold up to rounding."""
        return self.sound_within(GAP)

    def sound_within(self, gap: float, excess: float = EXCESS) -> bool:
        """Return whether all conditions hold, with a gain by better controls up to a share of the cost.

        Args:
            gap: accepted gain, share of the cost.
            excess: accepted violation of a state limit, share of its range.
        """
        exceeded = any(crossing.share > excess for crossing in self.crossings)
        return self.gap <= gap and not (exceeded or self.jumps or self.released)


def certify(task: ArcProblem, motion: ArcMotion) -> Certificate:
    """Check the necessary conditions of a motion of given structure.

    Args:
        task: the problem.
        motion: the solution of its NLP.

    Arcs on a limit of odd order from three on join no others where the Hamiltonian is convex in the control: such a
    limit is touched only.

    Source: Hartl, Sethi, Vickson, A survey of the maximum principles for optimal control problems with state
        constraints, SIAM Review 37, 1995 (direct adjoining); Jacobson, Lele, Speyer, New necessary conditions of
        optimality for control problems with state-variable inequality constraints, J. Math. Anal. Appl. 35, 1971.
    """
    limits, scheme = task.limits, task.scheme
    each, signs = _signs(task, motion)
    cost = max(abs(motion.result.cost), 1e-300)
    sizes = [limit.range / cost for limit in limits]
    # At an upper limit multipliers and jumps are positive, at a lower one negative. Jumps at the ends of an arc on a
    # limit are derivatives of its multiplier and noisy on a short arc; those of a touch point are NLP multipliers.
    jumps = tuple(
        j
        for j in motion.jumps
        if j.height * j.contact.side * sizes[j.contact.limit] < -(SIGNIFICANT if j.contact.control < 0 else RELEASED)
    )
    # The multiplier is a high derivative and noisy on a short arc; its integral is not.
    pushes = [
        float(np.sum(p.values * p.contact.side * _seconds(motion, p.arc, scheme))) for p in motion.limit_multipliers
    ]
    released = tuple(
        (p.arc, p.contact)
        for p, push in zip(motion.limit_multipliers, pushes, strict=True)
        if push * sizes[p.contact.limit] < -RELEASED
    )
    held = ((k, c, len(task.chain(c)) - 1) for k, arc in enumerate(motion.arcs) for c in arc.held if c.control >= 0)
    released += tuple((k, c) for k, c, order in held if order >= 3 and order % 2 and c.control not in task.singular)
    return Certificate(float(each.sum()), signs, crossings_of(task, motion), jumps, released, each)


def _seconds(motion: ArcMotion, arc: int, scheme: Scheme) -> Array:
    """Return the quadrature weights (e, d) of the points of an arc [s]."""
    return np.asarray(motion.duration * motion.grid.widths[motion.arc == arc][:, None] * scheme.weights)


def complaint(task: ArcProblem, certificate: Certificate) -> str:
    """Return the worst violated condition as a sentence.

    Args:
        task: the problem.
        certificate: of its motion.
    """
    limits, system = task.limits, task.problem.system
    if certificate.crossings and certificate.crossings[0].share > EXCESS:
        worst = certificate.crossings[0]
        label = limits[worst.contact.limit].label
        return f"{label.name} exceeds its limit by {worst.share:.1e} of its range at {worst.worst:.6g} s"
    if certificate.jumps or certificate.released:
        contact = certificate.jumps[0].contact if certificate.jumps else certificate.released[0][1]
        return f"the multiplier of the limit of {limits[contact.limit].label.name} has the wrong sign"
    reason = f"the switching functions leave a gain of {certificate.gap:.1e} of the cost"
    if certificate.signs:
        worst_sign = certificate.signs[0]
        name = system.label("u", system.u.numel())[worst_sign.control].name
        reason += f", most of it by {name} from {worst_sign.start:.6g} to {worst_sign.end:.6g} s"
    return reason


def _signs(task: ArcProblem, motion: ArcMotion) -> tuple[Array, tuple[WrongSign, ...]]:
    """Return the gap of every element (N,) and the intervals with a wrong sign, worst first."""
    problem, scheme = task.problem, task.scheme
    tau = np.concatenate([[0.0], scheme.points[(scheme.points > 0.0) & (scheme.points < 1.0)], [1.0]])
    n, s = len(motion.grid), len(tau)
    x = np.einsum("sm,kma->ksa", scheme.state_at(tau)[:, : len(scheme.nodes)], motion.states).reshape(n * s, -1)
    u = np.einsum("sm,kma->ksa", scheme.control_at(tau), motion.controls).reshape(n * s, -1)
    costates = np.einsum("sm,kma->ksa", scheme.costate_at(tau), motion.costates).reshape(n * s, -1)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    u = np.clip(u, low, high)
    result = switching_functions(problem, x, u, costates, motion.parameters)
    pushes = pushes_along(task, motion, (x, u), result.values)
    if pushes is not None:
        result = switching_functions(problem, x, u, costates, motion.parameters, pushes)
    shares, gains = result.shares, result.gains
    if np.any(motion.pressed):
        shares, gains = _smoothed(task, motion, (shares, gains, result.values), (x, u), tau)
    gains = np.where(np.abs(shares) > SIGNIFICANT, gains, 0.0)
    seconds = motion.duration * motion.grid.widths
    t = (motion.duration * motion.grid.ends[:-1, None] + seconds[:, None] * tau).ravel()
    # The trapezoidal rule is accurate enough for a quantity that should vanish.
    weight = np.zeros(s)
    weight[:-1] += np.diff(tau) / 2.0
    weight[1:] += np.diff(tau) / 2.0
    weights = (seconds[:, None] * weight).ravel()
    kinds = np.array([[a.kinds[i].value for i in range(u.shape[1])] for a in motion.arcs])[np.repeat(motion.arc, s)]
    wrong: list[WrongSign] = []
    mixed = np.array([[is_held(task, a, i) for i in range(u.shape[1])] for a in motion.arcs])[np.repeat(motion.arc, s)]
    cost = max(abs(motion.result.cost), 1e-300)
    for i in range(u.shape[1]):
        for kind, wanted in ((Kind.LOWER, Kind.UPPER), (Kind.UPPER, Kind.LOWER)):
            away = result.values[:, i] < 0.0 if wanted is Kind.UPPER else result.values[:, i] > 0.0
            bad = (gains[:, i] > 0.0) & ((kinds[:, i] == kind.value) | (mixed[:, i] & away))
            edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
            for a, b in zip(edges[::2], edges[1::2], strict=True):
                gain = float(weights[a:b] @ gains[a:b, i])
                if gain > LEAST * cost:
                    # A single point at the end of an element stands for the way to the next point.
                    first = a - 1 if b - a == 1 and a % s == s - 1 else a
                    last = b if b - a == 1 and a % s == 0 else b - 1
                    worst = a + int(np.argmax(gains[a:b, i]))
                    point = x[worst], u[worst], motion.parameters
                    aim = (Kind.INTERIOR, None) if result.inside[worst, i] else aim_of(task, point, i, wanted)
                    wrong.append(WrongSign(i, float(t[first]), float(t[last]), gain, *aim))
    each = (weights * gains.sum(axis=1)).reshape(n, s).sum(axis=1) / cost
    return each, tuple(sorted(wrong, key=lambda w: -w.gain))


def _smoothed(
    task: ArcProblem, motion: ArcMotion, functions: tuple[Array, Array, Array], point: tuple[Array, Array], tau: Array
) -> tuple[Array, Array]:
    """Return shares and gains with smooth switching functions on elements where state limits press at single points.

    There the costates jump at these points, and the switching function of a control that is free to follow the limit
    vanishes in the mean over the element only: the line through its values at the collocation points is taken.

    Args:
        task: the problem.
        motion: its motion.
        functions: shares, gains and values (N s, nu) at the points.
        point: states (N s, nx) and controls (N s, nu).
        tau: (s,) points of each element.
    """
    scheme, n = task.scheme, len(motion.grid)
    x, u = point
    low, high = (side.reshape(n, len(tau), -1) for side in sides_of(task.problem, x, u, motion.parameters))
    at_points = np.isin(tau, scheme.points)
    basis, root = np.vander(scheme.points, 2), np.sqrt(scheme.weights)
    fit = basis @ np.linalg.pinv(root[:, None] * basis) * root
    between = np.searchsorted(scheme.points, tau).clip(0, len(scheme.points) - 1)
    shares, gains, values = (part.reshape(n, len(tau), -1).copy() for part in functions)
    at = u.reshape(shares.shape)
    for i in sorted(task.singular):
        for k in np.flatnonzero(motion.pressed & np.all(np.isfinite(high[:, :, i] - low[:, :, i]), axis=1)):
            own, free = values[k, at_points, i], motion.arcs[motion.arc[k]].kinds[i] is Kind.INTERIOR
            line = (fit @ own)[between]
            each = [
                s * np.where(s > 0.0, at[k, :, i] - low[k, :, i], at[k, :, i] - high[k, :, i])
                for s in (line, own[between])
            ]
            gains[k, :, i] = np.maximum(each[0] if free else np.minimum(*each), 0.0)
            scale = np.max(np.abs(values[k, :, i]))
            shares[k, :, i] *= np.max(np.abs(line)) / scale if scale else 0.0
    return shares.reshape(n * len(tau), -1), gains.reshape(n * len(tau), -1)


def crossings_of(task: ArcProblem, motion: ArcMotion | Solution) -> tuple[Crossing, ...]:
    """Return where state limits are exceeded, between the nodes as well, the worst first.

    Args:
        task: the problem, with the scheme of the motion.
        motion: any motion.
    """
    limits, scheme = task.limits, task.scheme
    if not limits:
        return ()
    tau = np.linspace(0.0, 1.0, BETWEEN + 1)
    n, s = len(motion.grid), len(tau)
    x = np.einsum("sm,kma->ksa", scheme.state_at(tau)[:, : len(scheme.nodes)], motion.states).reshape(n * s, -1)
    u = np.einsum("sm,kma->ksa", scheme.control_at(tau), motion.controls).reshape(n * s, -1)
    t = (motion.duration * (motion.grid.ends[:-1, None] + motion.grid.widths[:, None] * tau)).ravel()
    values = np.array(mapped(task.levels, len(t))(x.T, u.T, np.tile(motion.parameters[:, None], len(t))))
    results: list[Crossing] = []
    for number, limit in enumerate(limits):
        for side in (-1, 1):
            if not np.isfinite(limit.at(side)):
                continue
            share = side * (values[number] - limit.at(side)) / limit.range
            bad = share > ROUNDING
            edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(int), [0]])))
            for a, b in zip(edges[::2], edges[1::2], strict=True):
                worst = a + int(np.argmax(share[a:b]))
                crossing = Crossing(
                    Contact(number, side), float(t[a]), float(t[b - 1]), float(t[worst]), float(share[worst])
                )
                results.append(crossing)
    return tuple(sorted(results, key=lambda c: -c.share))
