"""The last step that all forms share: mechanics in chosen velocity coordinates become a System."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from models.frames import Frame, without_negligible
from models.mechanics import Mechanics
from models.terms import Effect, Quantity
from ocp.system import Label, System


def as_system(
    mechanics: Mechanics,
    frame: Frame,
    symbol: ca.SX,
    w: ca.SX,
    v: ca.SX,
    symbol_rate: ca.SX,
    form: Callable[[Sequence[Effect]], System],
) -> System:
    """Return the System with x = [q; symbol; states of effects] and u = the control, tau for ideal drives.

    Args:
        mechanics: machine and effects.
        frame: in which w is meant.
        symbol: (n,) symbols of v, w or p, whichever the form has as state.
        w: (n,) quasi-velocities in terms of q and symbol.
        v: (n,) velocities dq/dt in terms of q and symbol.
        symbol_rate: (n,) d(symbol)/dt.
        form: makes the same System with other effects, to price those that couple the metric.

    Raises:
        ValueError: an effect defines a signal that every machine has.
    """
    machine, terms, states = mechanics.machine, mechanics.terms, mechanics.terms.states

    def final(expression: ca.SX) -> ca.SX:
        return ca.substitute(mechanics.resolved(expression), machine.v, v)

    kind = symbol[0].name()[0]
    third = {} if kind == "v" else {kind: Quantity(symbol, "", tuple(s.name() for s in ca.vertsplit(symbol)))}
    kinetic = ca.dot(w, frame.metric @ w) / 2
    published = {**_of_every_machine(mechanics, kinetic), **third}
    for name, quantity in terms.signals.items():
        if name in published:
            raise ValueError(f"an effect defines the signal {name!r}, which every machine has; rename it")
        published[name] = quantity
    for name, state in states.items():
        if name in published:
            raise ValueError(f"an effect defines the state {name!r}, which is a signal already; rename it")
        published[name] = Quantity(state.symbol, state.unit)

    signals = {name: final(quantity.expression) for name, quantity in published.items()}
    labels = {name: tuple(Label(*pair) for pair in quantity.labelled(name)) for name, quantity in published.items()}
    labels["x"] = labels["q"] + labels["v" if kind == "v" else kind]
    labels["x"] += tuple(Label(name, state.unit) for name, state in states.items())
    labels["u"] = tuple(Label(*pair) for pair in mechanics.control.labelled("u"))
    parameters = mechanics.parameters
    x = ca.vertcat(machine.q, symbol, *(state.symbol for state in states.values()))
    u, p = mechanics.control.expression, ca.vertcat(*parameters.values()) if parameters else ca.SX(0, 1)
    rates = [final(state.rate) for state in states.values()]
    rate = ca.cse(ca.densify(ca.vertcat(v, symbol_rate, *rates)))
    return System(
        x=x,
        u=u,
        p=p,
        rate=rate,
        signals=signals,
        nominal={**{name: machine.nominal[name] for name in machine.symbols}, **terms.nominal},
        labels=labels,
        notes=coupling(mechanics, frame, ca.Function("rate", [x, u, p], [rate]), form),
        limits=terms.limits,
        initial={name: state.initial for name, state in states.items() if state.initial is not None},
    )


def _of_every_machine(mechanics: Mechanics, kinetic: ca.SX) -> dict[str, Quantity]:
    """Return the signals that do not depend on which effects there are, and those of the drives and of losses."""
    machine, terms = mechanics.machine, mechanics.terms
    names, units = tuple(c.name for c in machine.coordinates), tuple(c.unit for c in machine.coordinates)
    forces = tuple(c.force_unit for c in machine.coordinates)
    rates = tuple(f"{unit}/s" for unit in units)
    motor_q, motor_v, motor_tau = mechanics.motors
    found = {
        "q": Quantity(machine.q, units, names),
        "v": Quantity(machine.v, rates, tuple(f"d{name}/dt" for name in names)),
        "tau": Quantity(mechanics.tau, forces, tuple(f"tau_{name}" for name in names)),
        "tool": Quantity(machine.tool, "m", ("tool_x", "tool_y", "tool_z")),
        "power": Quantity(ca.dot(motor_tau, motor_v), "W"),
        "energy": Quantity(kinetic + mechanics.potential + terms.spring + terms.energy, "J"),
    }
    for i, drive in enumerate(machine.drives):
        found[drive.name] = Quantity(drive.sign * mechanics.tau[i], forces[i])
    if terms.transmission is not None:
        found["motor_q"] = Quantity(motor_q, units, tuple(f"motor_q_{name}" for name in names))
        found["motor_v"] = Quantity(motor_v, rates, tuple(f"motor_v_{name}" for name in names))
        found["motor_tau"] = Quantity(motor_tau, forces, tuple(f"motor_tau_{name}" for name in names))
    if terms.force is not None or not terms.dissipation.is_zero():
        lost = mechanics.applied + ca.gradient(terms.spring, machine.q)
        found["loss"] = Quantity(terms.dissipation - ca.dot(lost, machine.v), "W")
    held = mechanics.at_rest()
    if held:
        size = machine.q.numel()
        rest = ca.vertcat(machine.v, *held)
        found["rest"] = Quantity(rest, rates + ("",) * (rest.numel() - size))
    return found


def coupling(
    mechanics: Mechanics, frame: Frame, rate: ca.Function, form: Callable[[Sequence[Effect]], System]
) -> tuple[str, ...]:
    """Say which entries of the metric are off the diagonal in the frame, what put them there, and its price.

    The price of an effect is the number of instructions of the rate with it less that without it.
    """
    if frame.diagonal:
        return ()
    n = frame.q.numel()
    pairs = ", ".join(f"({j + 1}, {i + 1})" for i in range(n) for j in range(i) if frame.metric.has_nz(i, j))
    own = without_negligible(frame.inverse.T @ mechanics.machine.metric @ frame.inverse, frame.q)
    diagonal = ca.Sparsity.diag(n)
    culprits = [] if own.sparsity().is_subset(diagonal) else ["the parameters of the machine"]
    for part in mechanics.parts:
        if part.terms.metric is None or part.terms.metric.nnz() == 0:
            continue
        pulled = without_negligible(frame.inverse.T @ part.terms.metric @ frame.inverse, frame.q)
        if not pulled.sparsity().is_subset(diagonal):
            rest = [other.effect for other in mechanics.parts if other is not part and other.effect is not None]
            price = rate.n_instructions() - instructions(form(rest))
            culprits.append(f"the effect {part.name} (for {price} of {rate.n_instructions()} instructions)")
    by = " and ".join(culprits)
    return (
        f"the metric is not diagonal in the frame {frame.name!r}: the quasi-velocities {pairs} are coupled by {by}; "
        "it is factorised as L D L' instead of divided by its diagonal",
    )


def instructions(system: System) -> int:
    """Return the number of instructions of x' = rate(x, u, p)."""
    return int(ca.Function("rate", [system.x, system.u, system.p], [system.rate]).n_instructions())


def symbols(letter: str, n: int) -> ca.SX:
    """Return the n scalar symbols letter_1 .. letter_n as a column."""
    return ca.vertcat(*(ca.SX.sym(f"{letter}_{i + 1}") for i in range(n)))
