"""A controlled system x' = f(x, u, p) with named signals: the only bridge between models and optimal control."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from ocp import checks

NUMBERED = re.compile(r"_\d+$")  # end of the name of a component of a vector of symbols
Side = float | Sequence[float] | np.ndarray | None  # of a limit


@dataclass(frozen=True)
class Label:
    """Name and unit of one component of a signal."""

    name: str
    unit: str = ""

    def __post_init__(self) -> None:
        checks.text("Label: name", self.name)
        checks.text("Label: unit", self.unit)

    def __str__(self) -> str:
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True, eq=False)
class Singularity:
    """A singularity: a state at which a quantity vanishes and the equations of a system are not defined.

    Args:
        quantity: scalar expression in x and p.
        least: absolute value below which the equations have lost too many digits.
        words: what is singular and what to do about it, for messages; no full stop.
        crossed: whether the quantity changes its sign there, so that a step of an integrator may cross it unnoticed.
    """

    quantity: ca.SX
    least: float
    words: str
    crossed: bool = False


@dataclass(frozen=True, eq=False)
class Implicit:
    """A rate with unknowns of its own, rate(x, u, p, y) with y solving G(x, u, p, y) = 0, where dG/dy is symmetric.

    Its derivatives follow from those of the two short expressions, see `ocp.transcription.implicit`.

    Args:
        y: (ny,) symbols.
        rate: (nx,) dx/dt in terms of x, u, p, y.
        residual: (ny,) G.
        value: (ny,) y in terms of x, u, p.
        solve: function (x, u, p, b) -> (dG/dy)^-1 b, b of shape (ny,).
        signals: name -> expression in x, u, p, y of signals that are shorter in y.
        mirror: W (nx, nx), numbers or in p, and `rest` (nx,) with d(rate)/dy = d(rest)/dy + W (dG/dx)', for rates with
            the gradient by x of the function whose gradient by y is G; None for others.
    """

    y: ca.SX
    rate: ca.SX
    residual: ca.SX
    value: ca.SX
    solve: ca.Function
    signals: Mapping[str, ca.SX] = field(default_factory=dict)
    mirror: tuple[ca.DM | ca.SX, ca.SX] | None = None

    def extended(self, old: tuple[ca.SX, ca.SX], new: tuple[ca.SX, ca.SX], p: ca.SX, rate: ca.SX) -> Implicit:
        """Return the same for a system whose x and u were `old`, with `new` ones and the `rate` of added states."""
        right, mirror = ca.SX.sym("b", self.y.numel()), self.mirror
        solve = ca.Function("solve", [*new, p, right], [self.solve(*old, p, right)])
        if mirror is not None:
            mirror = ca.diagcat(mirror[0], ca.DM(rate.numel(), rate.numel())), ca.vertcat(mirror[1], rate)
        return replace(self, rate=ca.vertcat(self.rate, rate), solve=solve, mirror=mirror)


@dataclass(frozen=True, eq=False)
class System:
    """An ordinary differential equation in normal form, x' = rate(x, u, p), or rate(t, x, u, p) with a symbol t.

    Args:
        x: (nx,) symbols of the state.
        u: (nu,) symbols of the control.
        p: (np,) symbols of the parameters; left out if there are none.
        rate: (nx,) dx/dt as an expression in x, u, p.
        signals: name -> expression in x, u, p that may be bounded, minimised or plotted.
        nominal: value of every parameter, in the order of p.
        labels: signal name (or "x", "u") -> one Label for each component; missing ones are numbered.
        notes: sentences about how the system was built.
        limits: signal name -> (lower, upper), scalars, columns, or None; every Problem has them along the motion.
        initial: signal name -> value at t = 0 that `point_to_point` uses, such as 0 for a clock.
        singular: singularities that no motion may touch; `simulate`, `solve` and `verify` check them.
        t: scalar symbol of the time [s] in rate and signals. It becomes the last state, with rate 1 and label "t"; in a
            Problem it starts at 0 unless its start is constrained; initial states and guesses may leave it out.
        integrals: number of the last states that are integrals of the others, see `integral`.
        implicit: the same rate with unknowns of its own, for shorter derivatives; it is lost by pickling.

    Raises:
        TypeError: a part is not symbolic.
        ValueError: shapes disagree, or an expression has a symbol that is neither in x, u nor p.
    """

    x: ca.SX
    u: ca.SX
    p: ca.SX = None  # type: ignore[assignment]
    rate: ca.SX = None  # type: ignore[assignment]
    signals: Mapping[str, ca.SX] = field(default_factory=dict)
    nominal: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, tuple[Label, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    limits: Mapping[str, tuple[Side, Side]] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    singular: tuple[Singularity, ...] = ()
    implicit: Implicit | None = None
    t: ca.SX | None = None
    integrals: int = 0

    def __post_init__(self) -> None:
        checks.expression("System: rate", self.rate, "dx/dt as an expression in x, u, p")
        if self.p is None and self.nominal:
            raise TypeError(f"System: p is None, expected symbols for {checks.shown(self.nominal)}")
        for name in ("p", "u"):
            if _empty(getattr(self, name), name == "p"):
                object.__setattr__(self, name, ca.SX(0, 1))
        if self.t is not None:
            self._add_clock(self.t)
        checks.whole("System: integrals", self.integrals, 0)
        for name, part in (("x", self.x), ("u", self.u), ("p", self.p), ("rate", self.rate)):
            checks.expression(f"System: {name}", part, "a CasADi SX column")
            if part.numel() and part.shape[1] != 1:
                raise ValueError(f"System: {name} has shape {part.shape}, expected a column")
            if name != "rate" and not part.is_valid_input():
                raise ValueError(f"System: {name} must be made of symbols, got {part}")
        if self.rate.numel() != self.x.numel():
            raise ValueError(f"System: rate has {self.rate.numel()} components, x has {self.x.numel()}; give as many")
        for name in ("signals", "nominal", "labels", "limits", "initial"):
            checks.mapping(f"System: {name}", getattr(self, name), "a dict by name")
        checks.instance("System: notes", self.notes, tuple | list, "a tuple of sentences")
        for note in self.notes:
            checks.text("System: notes, each", note, "a sentence")
        if len(self.nominal) != self.p.numel():
            raise ValueError(
                f"System: nominal names {len(self.nominal)} parameters ({', '.join(self.nominal) or 'none'}), "
                f"p has {self.p.numel()}; give one value for each, in the order of p"
            )
        self.values()
        repeated = ca.vertcat(self.x, self.u, self.p)
        if len({s.element_hash() for s in ca.vertsplit(repeated)}) < repeated.numel():
            raise ValueError("System: a symbol stands twice in x, u, p; every unknown needs one of its own")
        self.check_symbols("rate", self.rate)
        for name, expression in self.signals.items():
            if not isinstance(expression, ca.SX):
                raise TypeError(f"System: signal {name!r} is a {type(expression).__name__}, expected a CasADi SX")
            self.check_symbols(f"signal {name!r}", expression)
        for name, labels in self.labels.items():
            checks.instance(f"System: labels of {name!r}", labels, tuple | list, "a tuple of Labels")
            size = (self.x if name == "x" else self.u if name == "u" else self[name]).numel()
            if len(labels) != size:
                raise ValueError(f"System: {len(labels)} labels for {name!r}, which has {size} components")
        for given, names in (("limits", self.limits), ("initial", self.initial)):
            for name in (name for name in names if name not in self.signals):
                known = ", ".join(self.signals) or "none"
                raise ValueError(f"System: {given} has {name!r}, expected one of the signals {known}")
        checks.instance("System: singular", self.singular, tuple | list, "a tuple of Singularities")
        for item in self.singular:
            checks.instance("System: singular, each", item, Singularity, "a Singularity")
            self.check_symbols("singular", item.quantity)
            if ca.depends_on(item.quantity, self.u):
                raise ValueError(f"System: the quantity of {item.words!r} depends on the control; expected x and p")
        checks.instance("System: implicit", self.implicit, Implicit | None, "an Implicit rate, or None")
        if self.implicit is not None and (rows := self.implicit.rate.numel()) != (nx := self.x.numel()):
            raise ValueError(f"System: the implicit rate has {rows} components, x has {nx}; give as many")

    def short(self, expression: ca.SX) -> ca.SX:
        """Return a scalar in terms of the unknowns y of the implicit rate where it is a component of its signals."""
        checks.expression("expression", expression)
        for name, column in ({} if self.implicit is None else self.implicit.signals).items():
            for explicit, short in zip(ca.vertsplit(self.signals[name]), ca.vertsplit(column), strict=True):
                if ca.is_equal(expression, explicit):
                    return short
        return expression

    def __reduce__(self) -> tuple[object, ...]:
        # Graphs cannot travel to another process, functions can: the expressions are rebuilt on new symbols.
        outputs = [ca.densify(self.rate), *self.signals.values(), *(item.quantity for item in self.singular)]
        function = ca.Function("system", [self.x, self.u, self.p], outputs)
        data: tuple[object, ...] = (dict(self.nominal), dict(self.labels), self.notes)
        data += (dict(self.limits), dict(self.initial))
        if self.singular:
            data += (tuple((item.least, item.words, item.crossed) for item in self.singular),)
        if self.t is not None or self.integrals:
            data += (self.clock, self.integrals) if self.singular else ((), self.clock, self.integrals)
        return rebuild, (function, tuple(self.signals), *data)

    def _add_clock(self, t: ca.SX) -> None:
        """Make the symbol of the time a state, unless it is one already (in a copy of a system)."""
        checks.expression("System: t", t, "a symbol such as casadi.SX.sym('t')")
        if t.numel() != 1 or not t.is_symbolic():
            raise ValueError(f"System: t is {checks.shown(t)}, expected one symbol of the time")
        checks.expression("System: x", self.x, "a CasADi SX column")
        if self.clock >= 0:
            if self.clock >= self.rate.numel() or not self.rate[self.clock].is_one():
                raise ValueError("System: t is one of the states x; expected a symbol of its own")
            return
        for name, given in (("signals", self.signals), ("labels", self.labels)):
            checks.mapping(f"System: {name}", given, "a dict by name")
        labels = (*self.label("x", self.x.numel()), Label("t", "s"))
        x, u = ca.vertcat(self.x, t), self.u
        if isinstance(self.implicit, Implicit):
            object.__setattr__(self, "implicit", self.implicit.extended((self.x, u), (x, u), self.p, ca.SX(1)))
        for name, part in (("x", x), ("rate", ca.vertcat(self.rate, 1.0)), ("signals", {"t": t, **self.signals})):
            object.__setattr__(self, name, part)
        object.__setattr__(self, "labels", {"t": (Label("t", "s"),), **self.labels, "x": labels})

    @property
    def clock(self) -> int:
        """Index of the time among the states; -1 without a symbol of the time."""
        own, hashes = 0 if self.t is None else self.t.element_hash(), [s.element_hash() for s in ca.vertsplit(self.x)]
        return hashes.index(own) if self.t is not None and own in hashes else -1

    def check_symbols(self, what: str, expression: ca.SX) -> None:
        """Raise ValueError if `expression` has a symbol that is not in x, u or p, TypeError if it is no CasADi SX."""
        checks.text("what", what, "a name for messages")
        checks.expression(what, expression)
        known = {s.element_hash() for s in ca.symvar(ca.vertcat(self.x, self.u, self.p))}
        foreign = [str(s) for s in ca.symvar(expression) if s.element_hash() not in known]
        if foreign:
            raise ValueError(
                f"{what} has symbols that are not in x, u or p of the system: {', '.join(foreign)}; "
                "use those of the system (two symbols of one name are two symbols)"
            )

    def __getitem__(self, name: str) -> ca.SX:
        """Return the signal called `name`, or raise KeyError with the names there are."""
        if isinstance(name, str) and name in self.signals:
            return self.signals[name]
        raise KeyError(f"no signal {checks.shown(name)}; this system has {', '.join(self.signals) or 'none'}")

    def label(self, name: str, size: int) -> tuple[Label, ...]:
        """Return the labels of a signal (or of "x", "u") with `size` components."""
        checks.text("name", name)
        checks.whole("size", size, 0, of="components")
        own = name in ("x", "u") and size == getattr(self, name).numel()
        return self.labels.get(name) or (_labels_of_symbols(self, name) if own else _numbered(name, size))

    def values(self, given: Mapping[str, float] | None = None) -> list[float]:
        """Return the parameter values in the order of p, nominal where `given` has no entry.

        Raises:
            ValueError: `given` names a parameter that the system does not have, or a value that is not finite.
        """
        given = {} if given is None else given
        checks.mapping("values", given, "a dict parameter name -> number, or None")
        for name in given:
            if name not in self.nominal:
                raise ValueError(f"no parameter {name!r}; this system has {', '.join(self.nominal) or 'none'}")
        values = {**self.nominal, **given}.items()
        return [checks.number(f"parameter {name!r}", value, "a finite number") for name, value in values]


@functools.lru_cache(maxsize=128)
def _labels_of_symbols(system: System, name: str) -> tuple[Label, ...]:
    """Return the names of the symbols of x or u as labels, numbered ones if they have none of their own."""
    names = [symbol.name() for symbol in ca.symvar(getattr(system, name))]
    own = len(set(names)) == len(names) and not any(map(NUMBERED.search, names))
    return tuple(map(Label, names)) if own else _numbered(name, len(names))


def _numbered(name: str, size: int) -> tuple[Label, ...]:
    return (Label(name),) if size == 1 else tuple(Label(f"{name}_{i + 1}") for i in range(size))


def _empty(part: object, optional: bool) -> bool:
    return part.numel() == 0 if isinstance(part, ca.SX) else optional and repr(part) in ("None", "[]", "()")


def rebuild(
    function: ca.Function, names: tuple[str, ...], nominal: Mapping[str, float],
    labels: Mapping[str, tuple[Label, ...]], notes: tuple[str, ...], limits: Mapping[str, tuple[Side, Side]],
    initial: Mapping[str, float], singular: tuple[tuple[float, str, bool], ...] = (), clock: int = -1,
    integrals: int = 0,
) -> System:  # fmt: skip
    """Return the System with the expressions of a function (x, u, p) -> (rate, *signals, *quantities), on new symbols.

    Of each singularity all but its quantity is given; `clock` is the index of the time among the states, or -1.
    """
    x, u, p = (ca.SX.sym(name, function.size1_in(i)) for i, name in enumerate(("x", "u", "p")))
    rate, *rest = function.call([x, u, p])
    named = dict(zip(names, rest[: len(names)], strict=True))
    items = tuple(Singularity(q, *known) for q, known in zip(rest[len(names) :], singular, strict=True))
    t = x[clock] if clock >= 0 else None
    return System(x, u, p, rate, named, nominal, labels, notes, limits, initial, items, None, t, integrals)
