"""From the equations of motion of a form to a System with named signals; shared by all forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from models.machines.frames import Frame, without_negligible
from models.mechanics.mechanics import Mechanics
from models.mechanics.singular_metric import singularities, vanishing_inertia
from models.mechanics.terms import OF_MOTION, Quantity
from ocp.system import Implicit, Label, Singularity, System


@dataclass(frozen=True, eq=False)
class InnerEquations:
    """Equations of motion with unknowns y that solve G = 0, where dG/dy is the metric."""

    y: ca.SX  # (n,) symbols
    v: ca.SX  # (n,) dq/dt in terms of q, symbol and y
    rate: ca.SX  # (n,) d(symbol)/dt in terms of q, symbol, y, states and control
    residual: ca.SX  # (n,) G
    value: ca.SX  # (n,) y in terms of q, symbol, states and control
    solve: Callable[[ca.SX], ca.SX]  # right (n,) -> M^-1 right, in terms of q
    reads_v: bool = False  # whether v is y
    other: ca.SX | None = None  # (n,) the rate less a part whose derivative by y is (dG/dq)'; None: there is none


@dataclass(frozen=True, eq=False)
class Accelerations:
    """Accelerations as the control, and the control of the drives that causes them."""

    control: Quantity  # (n,) symbols
    of_drives: ca.SX  # (n,) in terms of q, v, the accelerations and the clock


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations of motion in velocity coordinates of a form."""

    frame: Frame  # of the quasi-velocities w
    symbol: ca.SX  # (n,) symbols of the second half of the state: v, w or p
    w: ca.SX  # (n,) quasi-velocities in terms of q and symbol
    v: ca.SX  # (n,) velocities dq/dt in terms of q and symbol
    rate: ca.SX  # (n,) d(symbol)/dt
    kinetic: ca.SX | None = None  # kinetic energy; None: w' g' w / 2 in the frame
    notes: tuple[str, ...] = ()  # sentences about how the equations were built
    inner: InnerEquations | None = None  # the same with unknowns of their own, for shorter derivatives
    accelerations: Accelerations | None = None  # None: the drives are the control


Form = Callable[[Mechanics], Equations]


def as_system(mechanics: Mechanics, form: Form) -> System:
    """Return the System with x = [q; symbol; states of effects] and u = the control, tau for ideal drives.

    With accelerations as the control, the control of the drives is an expression in them, and so are tau and all that
    depends on it.

    Args:
        mechanics: machine and effects.
        form: function that returns the equations of motion of the mechanics.

    Raises:
        ValueError: an effect defines a signal that every machine has, or reads one that no effect defines.
    """
    machine, terms, states = mechanics.machine, mechanics.terms, mechanics.terms.states
    equations = form(mechanics)
    frame, symbol, w = equations.frame, equations.symbol, equations.w
    kind = symbol[0].name()[0]
    third = {} if kind == "v" else {kind: Quantity(symbol, "", tuple(s.name() for s in ca.vertsplit(symbol)))}
    kinetic = ca.dot(w, frame.metric @ w) / 2 if equations.kinetic is None else equations.kinetic
    published = {**_of_every_machine(mechanics, kinetic, symbol), **third}
    for name, quantity in terms.signals.items():
        if name in published:
            raise ValueError(f"an effect defines the signal {name!r}, which every machine has; rename it")
        published[name] = quantity
    for name, state in states.items():
        if name in published:
            raise ValueError(f"an effect defines the state {name!r}, which is a signal already; rename it")
        published[name] = Quantity(state.symbol, state.unit)

    signals = {name: _final(mechanics, equations, quantity.expression) for name, quantity in published.items()}
    labels = {name: tuple(Label(*pair) for pair in quantity.labelled(name)) for name, quantity in published.items()}
    labels["x"] = labels["q"] + labels["v" if kind == "v" else kind]
    labels["x"] += tuple(Label(name, state.unit) for name, state in states.items())
    control = mechanics.control if equations.accelerations is None else equations.accelerations.control
    labels["u"] = tuple(Label(*pair) for pair in control.labelled("u"))
    x, u, p, rate = _rate(mechanics, equations)
    signals = _with_motion(mechanics, signals, (x, u, rate))
    nominal = {**{name: machine.nominal[name] for name in machine.symbols}, **terms.nominal}
    singular: tuple[Singularity, ...] = ()
    if equations.accelerations is not None:
        notes = (*machine.notes, *equations.notes)
    elif mechanics.recursion is None:
        singular = singularities(machine, frame, mechanics.frame(None), nominal)
        count = ca.Function("rate", [x, u, p], [rate]).n_instructions()
        notes = coupling(mechanics, frame, form, count, equations.notes)
    else:
        singular = vanishing_inertia(machine, mechanics.recursion.pivots, nominal)
        notes = (*machine.notes, *equations.notes)
    return System(
        x=x,
        u=u,
        p=p,
        rate=rate,
        signals=signals,
        nominal=nominal,
        labels=labels,
        notes=notes,
        limits=terms.limits,
        initial={name: state.initial for name, state in states.items() if state.initial is not None},
        singular=singular,
        implicit=None if equations.inner is None else _implicit(mechanics, equations.inner, x, u, p, signals),
    )


def _with_motion(
    mechanics: Mechanics, signals: dict[str, ca.SX], equations: tuple[ca.SX, ca.SX, ca.SX]
) -> dict[str, ca.SX]:
    """Return the signals with accelerations and jerks, which follow from the rate, in those that read them.

    Raises:
        ValueError: a jerk is read, and depends on the rate of a control.
    """
    reads = [read for read in mechanics.terms.reads if read.name in OF_MOTION]
    if not reads:
        return signals
    x, u, rate = equations
    values = {"acceleration": ca.cse(ca.jtimes(signals["v"], x, rate))}
    if any(read.name == "jerk" for read in reads):
        if ca.depends_on(values["acceleration"], u):
            read = next(read for read in reads if read.name == "jerk")
            raise ValueError(
                f"{read.reader} limits the jerk, but torques of drives may jump; add {read.cure} to all drives"
            )
        values["jerk"] = ca.cse(ca.jtimes(values["acceleration"], x, rate))
    symbols, meanings = [read.symbol for read in reads], [values[read.name] for read in reads]
    return {name: ca.substitute([signal], symbols, meanings)[0] for name, signal in signals.items()}


def _implicit(
    mechanics: Mechanics, inner: InnerEquations, x: ca.SX, u: ca.SX, p: ca.SX, signals: dict[str, ca.SX]
) -> Implicit:
    """Return the implicit rate of a system, the rates of the states of effects included."""
    v, right = mechanics.machine.v, ca.SX.sym("b", inner.y.numel())
    states = [ca.substitute(mechanics.resolved(state.rate), v, inner.v) for state in mechanics.terms.states.values()]
    n, mirror = inner.y.numel(), None
    shorter = {"acceleration": inner.y} if inner.rate is inner.y and "acceleration" in signals else {}
    if inner.other is not None:
        weights = ca.DM.triplet(list(range(n, 2 * n)), list(range(n)), ca.DM.ones(n), x.numel(), x.numel())
        mirror = weights, ca.densify(ca.vertcat(inner.v, inner.other, *states))
    return Implicit(
        y=inner.y,
        rate=ca.densify(ca.vertcat(inner.v, inner.rate, *states)),
        residual=ca.densify(inner.residual),
        value=ca.densify(inner.value),
        solve=ca.Function("solve", [x, u, p, right], [inner.solve(right)]),
        signals={"v": inner.y} if inner.reads_v else shorter,
        mirror=mirror,
    )


def _final(mechanics: Mechanics, equations: Equations, expression: ca.SX) -> ca.SX:
    """Return an expression of an effect in terms of the states of the form and the control."""
    final = ca.substitute(mechanics.resolved(expression), mechanics.machine.v, equations.v)
    if equations.accelerations is None:
        return final
    return ca.substitute(final, mechanics.control.expression, equations.accelerations.of_drives)


def _rate(mechanics: Mechanics, equations: Equations) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return x, u, p and dx/dt."""
    states, parameters = mechanics.terms.states.values(), mechanics.parameters
    x = ca.vertcat(mechanics.machine.q, equations.symbol, *(state.symbol for state in states))
    control = mechanics.control if equations.accelerations is None else equations.accelerations.control
    u, p = control.expression, ca.vertcat(*parameters.values()) if parameters else ca.SX(0, 1)
    rates = [_final(mechanics, equations, state.rate) for state in states]
    return x, u, p, ca.cse(ca.densify(ca.vertcat(equations.v, equations.rate, *rates)))


def _of_every_machine(mechanics: Mechanics, kinetic: ca.SX, symbol: ca.SX) -> dict[str, Quantity]:
    """Return the signals of every machine, and those of elastic motors, losses and states at rest if there are any."""
    machine, terms = mechanics.machine, mechanics.terms
    names, units = tuple(c.name for c in machine.coordinates), tuple(c.unit for c in machine.coordinates)
    forces = tuple(c.force_unit for c in machine.coordinates)
    rates = tuple(f"{unit}/s" for unit in units)
    motor_q, motor_v, motor_tau = mechanics.motors
    results = {
        "q": Quantity(machine.q, units, names),
        "v": Quantity(machine.v, rates, tuple(f"d{name}/dt" for name in names)),
        "tau": Quantity(mechanics.tau, forces, tuple(f"tau_{name}" for name in names)),
        "tool": Quantity(machine.tool, "m", ("tool_x", "tool_y", "tool_z")),
        "power": Quantity(ca.dot(motor_tau, motor_v), "W"),
        "energy": Quantity(kinetic + mechanics.potential + terms.spring + terms.energy, "J"),
    }
    if machine.tool_axes is not None:
        axes = tuple(f"tool_axis_{j + 1}{i + 1}" for i in range(3) for j in range(3))
        results["tool_axes"] = Quantity(ca.vec(ca.densify(machine.tool_axes)), "1", axes)
    for i, drive in enumerate(machine.drives):
        results[drive.name] = Quantity(drive.sign * mechanics.tau[i], forces[i])
    if terms.transmission is not None:
        results["motor_q"] = Quantity(motor_q, units, tuple(f"motor_q_{name}" for name in names))
        results["motor_v"] = Quantity(motor_v, rates, tuple(f"motor_v_{name}" for name in names))
        results["motor_tau"] = Quantity(motor_tau, forces, tuple(f"motor_tau_{name}" for name in names))
    if terms.force is not None or not terms.dissipation.is_zero():
        lost = mechanics.applied + ca.gradient(terms.spring, machine.q)
        results["loss"] = Quantity(terms.dissipation - ca.dot(lost, machine.v), "W")
    held = mechanics.at_rest()
    if held or mechanics.recursion is not None:
        n = machine.q.numel()
        # Momenta and quasi-velocities vanish with v, and are states: bounds instead of constraints.
        rest = ca.vertcat(machine.v if mechanics.recursion is None else symbol, *held)
        results["rest"] = Quantity(rest, rates + ("",) * (rest.numel() - n))
    return results


def coupling(
    mechanics: Mechanics, frame: Frame, form: Form, count: int, built: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Return a note on the off-diagonal entries of the metric in the frame, or none if it is diagonal.

    The note names the effects that cause them, each with its instruction count: that of the rate with all effects,
    `count`, minus that of the rate without this one. It ends with how the equations were `built`.
    """
    if frame.diagonal:
        return built
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
            rest = Mechanics(mechanics.machine, tuple(other for other in mechanics.parts if other is not part))
            *inputs, rate = _rate(rest, form(rest))
            added = count - ca.Function("rate", inputs, [rate]).n_instructions()
            culprits.append(f"the effect {part.name} (for {added} of {count} instructions)")
    by = " and ".join(culprits)
    return (
        f"the metric is not diagonal in the frame {frame.name!r}: the quasi-velocities {pairs} are coupled by {by}; "
        + ("; ".join(built) or "it is factorised as L D L' instead of divided by its diagonal"),
    )


def symbols(letter: str, n: int) -> ca.SX:
    """Return the n scalar symbols letter_1 .. letter_n as a column."""
    return ca.vertcat(*(ca.SX.sym(f"{letter}_{i + 1}") for i in range(n)))
