"""Equations of motion of a machine with its effects, in any frame, from metric, frame and potential."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from models.machines.frames import Frame, curl, fixed
from models.machines.manipulator import Body, Manipulator
from models.machines.recursion import Recursion
from models.mechanics.partials import Partials, inertial
from models.mechanics.terms import OF_MOTION, Effect, Part, Quantity, Terms, gather
from models.rigid_bodies.segment_recursion import recursion_of
from ocp import checks


@dataclass(frozen=True, eq=False)
class Mechanics:
    """A machine and the Terms of its effects, written in q, v, the states of the effects and the control."""

    machine: Manipulator
    parts: tuple[Part, ...]

    @cached_property
    def terms(self) -> Terms:
        """Sum of the terms of all effects."""
        return sum((part.terms for part in self.parts), Terms())

    @property
    def metric(self) -> ca.SX:
        """(n, n) metric g(q) in coordinates, that of the effects included."""
        recursion, terms, n = self.machine.recursion, self.terms, self.machine.q.numel()
        own = self.machine.metric
        if recursion is not None and (terms.loads or terms.spins is not None):
            own = recursion.loaded(terms.loads).with_rotors(ca.SX(n, n), terms.spins).metric
        return own if self.terms.metric is None else own + self.terms.metric

    @cached_property
    def recursion(self) -> Recursion | None:
        """Recursion over the links with the loads and rotors of all effects.

        None for a machine whose metric is given in closed form, and if an effect adds a metric that depends on q.
        """
        own, terms = self.machine.recursion, self.terms
        if own is None or (terms.metric is not None and ca.depends_on(terms.metric, self.machine.q)):
            return None
        n = self.machine.q.numel()
        rotors = ca.SX(n, n) if terms.metric is None else ca.sparsify(terms.metric)
        return own.loaded(terms.loads).with_rotors(rotors, terms.spins)

    @cached_property
    def links(self) -> Recursion | None:
        """Recursion over the links of a machine with a metric in closed form, with the loads that effects fix to them.

        None without a rigid load at the tool (point masses keep the closed form, and studies of the first release their
        identity), and if another effect adds a metric that depends on q.
        """
        rigid = (load.offset.nnz() or load.inertia.nnz() for load in self.terms.loads if load.carrier is None)
        if self.machine.recursion is not None or not any(rigid):
            return None
        n = self.machine.q.numel()
        others = (part.terms.metric for part in self.parts if not part.terms.loads)
        rotors = sum((metric for metric in others if metric is not None), ca.SX(n, n))
        if ca.depends_on(rotors, self.machine.q):
            return None
        own = recursion_of(self.machine)
        return None if own is None else own.loaded(self.terms.loads).with_rotors(ca.sparsify(rotors))

    @property
    def gradient_beside_links(self) -> ca.SX:
        """(n,) gradient of the potential energy that is not the weight of the links and loads of `links`."""
        bodies = [body for part in self.parts if not part.terms.loads for body in part.terms.bodies]
        return self._slope(self._weighed(self.terms.potential, bodies))

    @cached_property
    def potential_gradient(self) -> ca.SX:
        """(n,) dU/dq, the weight of the links by recursion where the machine has one."""
        if self.recursion is None:
            return ca.gradient(self.potential, self.machine.q)
        return self.other_potential_gradient + self.recursion.gravity(self.field)

    @property
    def field(self) -> ca.SX:
        """(3,) acceleration of the field that acts on every mass."""
        return ca.SX(3, 1) if self.terms.acceleration is None else self.terms.acceleration

    @property
    def other_potential_gradient(self) -> ca.SX:
        """(n,) gradient of the potential energy that is not the weight of links and loads."""
        return self._slope(self._weighed(self.terms.potential, self.terms.bodies))

    def _weighed(self, potential: ca.SX, bodies: Sequence[Body]) -> ca.SX:
        for body in bodies:
            potential = potential + body.mass * ca.dot(-self.field, body.centre)
        return potential

    def _slope(self, potential: ca.SX) -> ca.SX:
        q = self.machine.q
        return ca.gradient(potential, q) if ca.depends_on(potential, q) else ca.SX(*q.shape)

    def inverse_dynamics(self, a: ca.SX) -> ca.SX:
        """Return the forces (n,) on the joints for accelerations a (n,), those of effects not subtracted."""
        machine, recursion = self.machine, self.recursion
        if recursion is None:
            return inertial(self.metric, machine.q, machine.v, a) + self.potential_gradient
        return recursion.inverse_dynamics(machine.v, a, self.field) + self.other_potential_gradient

    @property
    def control(self) -> Quantity:
        """(n,) control: of the drives, of the motors if joints are elastic, or the force on the joints itself."""
        coordinates = self.machine.coordinates
        if self.terms.source is not None:
            return self.terms.source.control
        elastic = self.terms.transmission
        units = tuple(c.force_unit for c in coordinates)
        if elastic is not None:
            return Quantity(elastic.motor_tau, units, tuple(f"motor_tau_{c.name}" for c in coordinates))
        return Quantity(self.machine.tau, units, tuple(f"tau_{c.name}" for c in coordinates))

    @cached_property
    def motors(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Position, velocity and torque of the motors, (n,) each, in units of the joints."""
        elastic = self.terms.transmission
        if elastic is None:
            return self.machine.q, self.machine.v, self.tau
        return elastic.motor_q, elastic.motor_v, self.resolved(elastic.motor_tau)

    @cached_property
    def tau(self) -> ca.SX:
        """(n,) force of the drives on the joints [N m or N]."""
        return self.resolved(self.machine.tau)

    @property
    def applied(self) -> ca.SX:
        """(n,) generalised forces of effects that are not in the potential; structural zeros if there are none."""
        n = self.machine.q.numel()
        return ca.SX(n, 1) if self.terms.force is None else self.resolved(self.terms.force)

    @property
    def force(self) -> ca.SX:
        """(n,) generalised forces that are not in the potential: drives and effects."""
        return self.tau if self.terms.force is None else self.tau + self.applied

    def resolved(self, expression: ca.SX) -> ca.SX:
        """Return an expression of an effect with the signals that it reads, and the torques of the drives, substituted.

        Raises:
            ValueError: an effect reads a signal that nobody defines, or signals depend on each other in a circle.
        """
        symbols, meanings = self._wires
        if not symbols:
            return expression
        known = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(*symbols))}
        for _ in range(len(symbols) + 1):
            if not any(symbol.element_hash() in known for symbol in ca.symvar(expression)):
                return expression
            (expression,) = ca.substitute([expression], symbols, meanings)
        names = ", ".join(sorted({read.name for read in self.terms.reads}))
        raise ValueError(f"effects read signals that depend on each other in a circle: {names}")

    @cached_property
    def _wires(self) -> tuple[list[ca.SX], list[ca.SX]]:
        machine, terms = self.machine, self.terms
        source, elastic = terms.source, terms.transmission
        motor_tau = machine.tau if elastic is None else elastic.motor_tau
        pairs = [] if source is None else [(motor_tau, source.torque)]
        pairs += [] if elastic is None else [(machine.tau, elastic.torque)]
        if terms.reads:
            motion = (machine.q, machine.v) if elastic is None else (elastic.motor_q, elastic.motor_v)
            known = {
                "q": machine.q, "v": machine.v, "tau": machine.tau, "tool": machine.tool,
                "tool_v": ca.jtimes(machine.tool, machine.q, machine.v),
                "motor_q": motion[0], "motor_v": motion[1], "motor_tau": motor_tau,
                **{name: quantity.expression for name, quantity in terms.signals.items()},
                **{name: state.symbol for name, state in terms.states.items()},
            }  # fmt: skip
            for read in (read for read in terms.reads if read.name not in OF_MOTION):
                if read.name not in known:
                    raise ValueError(
                        f"{read.reader} reads the signal {read.name!r}, which no effect of the list defines; "
                        f"add {read.cure} (signals here: {', '.join(known)})"
                    )
                if known[read.name].numel() != read.symbol.numel():
                    raise ValueError(f"{read.reader} reads {read.symbol.numel()} components of the signal "
                                     f"{read.name!r}, which has {known[read.name].numel()}")  # fmt: skip
                pairs.append((read.symbol, known[read.name]))
        return [symbol for symbol, _ in pairs], [ca.densify(meaning) for _, meaning in pairs]

    @property
    def parameters(self) -> dict[str, ca.SX]:
        """Parameters that stay symbols: those of the machine, then those of the effects in their order.

        Raises:
            ValueError: an effect and the machine have one of the same name.
        """
        for name in self.terms.symbols:
            if name in self.machine.symbols:
                raise ValueError(f"an effect defines the parameter {name!r}, which the machine has; rename it")
        return {**self.machine.symbols, **self.terms.symbols}

    @property
    def potential(self) -> ca.SX:
        """Potential energy U(q) [J]: of the effects, and of all masses in their field."""
        total, recursion = self.terms.potential, self.machine.recursion
        if self.terms.acceleration is not None:
            bodies = (*self.machine.bodies, *self.terms.bodies)
            if recursion is not None:
                total = total + recursion.loaded(self.terms.loads).potential(self.terms.acceleration)
                bodies = self.terms.bodies
            total = self._weighed(total, bodies)
        return total

    def at_rest(self) -> list[ca.SX]:
        """Return the quantities beside v that vanish at rest: velocities of elastic motors, and forces with a state.

        On a joint whose drive has a state, tau - dU/dq + forces of effects (g a at v = 0) cannot jump to zero.
        """
        control = self.control.expression
        _, motor_v, motor_tau = self.motors
        net = self.force - self.potential_gradient
        results = []
        for i in range(self.machine.q.numel()):
            elastic = not ca.depends_on(motor_v[i], self.machine.v)
            if elastic:
                results.append(motor_v[i])
            if elastic and not ca.depends_on(motor_tau[i], control):
                results.append(motor_tau[i] - self.tau[i])
            if not ca.depends_on(self.tau[i], control):
                results.append(net[i])
        return results

    def frame(self, chosen: str | Frame | None) -> Frame:
        """Return the frame called `chosen` (None: the default), or `chosen` itself, with the metric of effects."""
        if isinstance(chosen, Frame):
            return fixed(chosen)(self._added())
        return self.machine.frame(self.machine.default_frame if chosen is None else chosen, self._added())

    def _added(self) -> ca.SX:
        n = self.machine.q.numel()
        if self.machine.recursion is not None and (self.terms.loads or self.terms.spins is not None):
            return self.metric - self.machine.metric
        return ca.SX(n, n) if self.terms.metric is None else self.terms.metric


def assemble(machine: Manipulator, effects: Sequence[Effect]) -> Mechanics:
    """Return the mechanics of a machine with its effects.

    Args:
        machine: a Manipulator.
        effects: in any order.

    Raises:
        TypeError, ValueError: see `models.mechanics.terms.gather`.
    """
    if not isinstance(machine, Manipulator):
        raise TypeError(f"machine: got {checks.shown(machine)}, expected a Manipulator such as spherical()")
    return Mechanics(machine, gather(machine, effects))


def momentum_rate(mechanics: Mechanics, frame: Frame, w: ca.SX, p: ca.SX, partials: Partials) -> ca.SX:
    """Return dp'/dt in a frame, from quasi-velocities w and momenta p = g' w.

    p'_a = S_ia [ 1/2 w_b w_c d_i g'_bc + p_b (d_i F_bj - d_j F_bi) v_j - d_i U + Q_i ],  v = S w

    This is (2.3) with 1/2 w' (dg') w in place of the equal -1/2 p' d(g'^-1) p, which has a longer graph.

    Args:
        mechanics: machine and effects.
        frame: the frame, with its metric.
        w: (n,) quasi-velocities.
        p: (n,) momenta.
        partials: of the metric of the frame.

    Source: P. Maisser, Modellgleichungen fuer Manipulatoren, (1.5) and (2.3).
    """
    v = frame.inverse @ w
    force = partials.kinetic_gradient(w) - ca.gradient(mechanics.potential, frame.q)
    for b, i, j, entry in curl(frame):
        force[i] += p[b] * entry * v[j]
    applied = ca.substitute(mechanics.force, mechanics.machine.v, v)
    return frame.inverse.T @ (force + applied)
