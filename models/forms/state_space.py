"""The last step that all forms share: mechanics in chosen velocity coordinates become a System."""

from __future__ import annotations

import casadi as ca

from models.frames import Frame
from models.mechanics import Mechanics
from ocp.system import Label, System


def as_system(
    mechanics: Mechanics,
    frame: Frame,
    symbol: ca.SX,
    w: ca.SX,
    v: ca.SX,
    symbol_rate: ca.SX,
) -> System:
    """Return the System with x = [q; symbol; states of effects] and u = tau.

    Args:
        mechanics: machine and effects.
        frame: in which w is meant.
        symbol: (n,) symbols of v, w or p, whichever the form has as state.
        w: (n,) quasi-velocities in terms of q and symbol.
        v: (n,) velocities dq/dt in terms of q and symbol.
        symbol_rate: (n,) d(symbol)/dt.
    """
    machine, terms = mechanics.machine, mechanics.terms
    states = terms.states
    extra_rates = [ca.substitute(state.rate, machine.v, v) for state in states.values()]
    x = ca.vertcat(machine.q, symbol, *(state.symbol for state in states.values()))
    parameters = mechanics.parameters
    nominal = {**{name: machine.nominal[name] for name in machine.symbols}, **terms.nominal}
    kind = symbol[0].name()[0]
    signals = {
        "q": machine.q,
        "v": v,
        "tau": machine.tau,
        "tool": machine.tool,
        "power": ca.dot(machine.tau, v),
        "energy": ca.dot(w, frame.metric @ w) / 2 + mechanics.potential,
    }
    if kind != "v":
        signals[kind] = symbol
    units = [(c.name, c.unit) for c in machine.coordinates]
    labels = {
        "q": tuple(Label(name, unit) for name, unit in units),
        "v": tuple(Label(f"d{name}/dt", f"{unit}/s") for name, unit in units),
        "tau": tuple(Label(f"tau_{c.name}", c.force_unit) for c in machine.coordinates),
        "tool": tuple(Label(f"tool_{axis}", "m") for axis in "xyz"),
        "power": (Label("power", "W"),),
        "energy": (Label("energy", "J"),),
    }
    labels["x"] = labels["q"] + (labels["v"] if kind == "v" else tuple(Label(s.name()) for s in ca.vertsplit(symbol)))
    labels["x"] += tuple(Label(name, state.unit) for name, state in states.items())
    labels["u"] = labels["tau"]
    for drive, coordinate, force in zip(machine.drives, machine.coordinates, ca.vertsplit(machine.tau), strict=True):
        signals[drive.name] = drive.sign * force
        labels[drive.name] = (Label(drive.name, coordinate.force_unit),)
    for name, quantity in terms.signals.items():
        if name in signals:
            raise ValueError(f"an effect defines the signal {name!r}, which every machine has; rename it")
        signals[name] = ca.substitute(quantity.expression, machine.v, v)
        labels[name] = tuple(Label(name, quantity.unit) for _ in range(quantity.expression.numel()))
    for name, state in states.items():
        if name in signals:
            raise ValueError(f"an effect defines the state {name!r}, which is a signal already; rename it")
        signals[name], labels[name] = state.symbol, (Label(name, state.unit),)
    return System(
        x=x,
        u=machine.tau,
        p=ca.vertcat(*parameters.values()) if parameters else ca.SX(0, 1),
        rate=ca.cse(ca.densify(ca.vertcat(v, symbol_rate, *extra_rates))),
        signals=signals,
        nominal=nominal,
        labels=labels,
        notes=coupling(mechanics, frame),
    )


def coupling(mechanics: Mechanics, frame: Frame) -> tuple[str, ...]:
    """Say which entries of the metric are off the diagonal in the frame, if any."""
    if frame.diagonal:
        return ()
    n = frame.q.numel()
    pairs = [f"({j + 1}, {i + 1})" for i in range(n) for j in range(i) if frame.metric.has_nz(i, j)]
    by = "the effects and the machine" if mechanics.terms.metric is not None else "the machine's parameters"
    return (
        f"the metric is not diagonal in the frame {frame.name!r}: {by} couple the quasi-velocities "
        f"{', '.join(pairs)}; it is factorised as L D L' instead of divided by its diagonal",
    )


def symbols(letter: str, n: int) -> ca.SX:
    """Return the n scalar symbols letter_1 .. letter_n as a column."""
    return ca.vertcat(*(ca.SX.sym(f"{letter}_{i + 1}") for i in range(n)))
