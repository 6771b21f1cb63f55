"""Random search for trouble: every form in every frame at many random states of many random machines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from hard_cases.case import Case, Figure
from hard_cases.draws import KINDS, WHOLE, effects, parameters, states, symbolic
from hard_cases.extended import accelerations, extended
from models import Parameter, inverse_dynamics
from models.effects import Gravity
from models.forms import canonical, hamel, lagrange
from models.machines.frames import Frame, curl, partial_derivative
from models.machines.manipulator import Manipulator
from models.mechanics.mechanics import assemble
from models.mechanics.terms import Effect
from ocp.checks import Array
from ocp.system import System

FORMS = {"lagrange": lagrange, "hamel": hamel, "canonical": canonical}
VERTICAL = {"cylindrical": 0, "spherical": 1, "torus": 0}  # the coordinate about e_3; nothing depends on it
SINGULAR = {("spherical", "paper")}  # frames that a pose makes singular
SETS, EACH = 300, 40  # parameter sets of a machine, states of a set: 12000 states for each form and frame
FOLDED, STATES = 30, 40  # of a kind of machines with numbers and effects folded into the graph
EPS = float(np.finfo(float).eps)
# A backward stable solution of M a = f is wrong by c eps cond(M) |a|, c some multiple of the operations that led to M
# and f: some hundred. Fixed beforehand, for all machines, forms and frames.
MANY = 1e3


@dataclass(frozen=True, eq=False)
class Drawn:
    """Random states of random machines of one kind, and what is true of them."""

    machine: Manipulator
    points: tuple[Array, Array, Array, Array]  # q, v, tau (n, K), parameters (m, K), those of the machine before g
    truth: Array  # (n, K) accelerations of the bodies, extended precision
    weight: Array  # (n, K) sqrt(M_ii), which takes velocities to a norm without units
    size: Array  # (K,) |weight a| + |forces / weight|
    condition: Array  # (K,) of M / sqrt(M_ii M_jj)


def draw(name: str, sets: int = SETS, each: int = EACH, seed: int = 1) -> Drawn:
    """Return random states of random machines.

    Args:
        name: of a machine with all its parameters.
        sets, each: number of machines, and of states of each.
        seed: of the draws.
    """
    random = np.random.default_rng([seed, list(WHOLE).index(name)])
    machine = symbolic(name)
    columns = []
    for _ in range(sets):
        given = parameters(WHOLE[name], random, random.uniform(0.0, 3.0))
        numbers = [given[symbol] for symbol in machine.symbols] + [9.81 * 10.0 ** random.uniform(-3.0, 3.0)]
        columns.append((*states(machine, given, each, random), np.tile(np.array(numbers)[:, None], each)))
    q, v, tau, values = (np.hstack(parts) for parts in zip(*columns, strict=True))
    turned = q.copy()
    turned[VERTICAL[name]] = 0.0  # so that no rounding of the reference turns with the column
    truth, metric, forces = accelerations(machine, ca.SX.sym("g"), (turned, v, tau, values))
    weight = np.sqrt(np.array([metric[i, i] for i in range(len(q))]))
    size = np.linalg.norm(weight * truth, axis=0) + np.linalg.norm(forces / weight, axis=0)
    return Drawn(machine, (q, v, tau, values), truth, weight, size.astype(float), condition_of(metric))


def condition_of(metric: Array) -> Array:
    """Return the condition numbers (K,) of M_ij / sqrt(M_ii M_jj), the same in all units."""
    scale = np.sqrt(np.array([metric[i, i] for i in range(len(metric))]))
    moments = np.linalg.eigvalsh(np.moveaxis((metric / scale[:, None] / scale).astype(float), 2, 0))
    return np.asarray(moments[:, -1] / np.maximum(moments[:, 0], EPS * EPS))


def initial(machine: Manipulator, form: str, basis: Frame) -> ca.SX:
    """Return the state [q; v], [q; w] or [q; p] of a form in terms of q and v."""
    if form == "lagrange":
        return ca.vertcat(machine.q, machine.v)
    w = basis.matrix @ machine.v
    return ca.vertcat(machine.q, w if form == "hamel" else basis.metric @ w)


def acceleration(system: System) -> ca.SX:
    """Return d^2 q / dt^2 as d/dt of the signal v along the rate."""
    return ca.jtimes(system["v"], system.x, system.rate)


def forms_against_bodies(name: str) -> Iterator[Figure]:
    """Yield the worst error of the accelerations of every form in every frame, all parameters symbols."""
    drawn = draw(name)
    for frame in drawn.machine.frames:
        for form in FORMS:
            got, _, _, added = evaluate(drawn, form, frame)
            size = drawn.size + (added if (name, frame) in SINGULAR else 0.0)
            error = np.linalg.norm(drawn.weight * (got - drawn.truth), axis=0).astype(float) / size
            yield worst(error, drawn.condition, f"{form}, {frame}: {error.size} states, {SETS} machines")


def balances(name: str) -> Iterator[Figure]:
    """Yield the worst gap between the change of the energy and the power of the drives, form by form and frame."""
    drawn = draw(name, seed=2)
    speed = np.linalg.norm(drawn.weight * drawn.points[1], axis=0).astype(float)
    for frame in drawn.machine.frames:
        for form in FORMS:
            _, gained, power, added = evaluate(drawn, form, frame)
            size = speed * (drawn.size + (added if (name, frame) in SINGULAR else 0.0))
            yield worst(
                np.abs(gained - power) / size, drawn.condition, f"{form}, {frame}: {speed.size} states, {SETS} machines"
            )


def evaluate(drawn: Drawn, form: str, frame: str) -> tuple[Array, Array, Array, Array]:
    """Return accelerations (n, K), rate of the energy and power of the drives (K,), and sizes that the frame adds."""
    machine, (q, v, tau, numbers) = drawn.machine, drawn.points
    system, basis = FORMS[form](machine, [Gravity(Parameter(9.81))], frame), machine.frame(frame)
    own = ca.vertcat(*machine.symbols.values())
    begin = ca.Function("begin", [machine.q, machine.v, own], [initial(machine, form, basis), *detour(machine, basis)])
    outputs = [acceleration(system), ca.jtimes(system["energy"], system.x, system.rate), system["power"]]
    move = ca.Function("move", [system.x, system.u, system.p], [ca.densify(output) for output in outputs])
    count = q.shape[1]
    x, forces, turning = (np.array(part) for part in begin.map(count)(q, v, numbers[:-1]))
    got, gained, power = (np.array(part) for part in move.map(count)(x, tau, numbers))
    added = np.linalg.norm(forces / drawn.weight, axis=0) + np.linalg.norm(turning * drawn.weight, axis=0)
    return got, gained[0], power[0], added.astype(float)


def detour(machine: Manipulator, basis: Frame) -> tuple[ca.SX, ca.SX]:
    """Return the sizes of the forces and of the accelerations that a frame adds and takes away again, (n,) each.

    f_i = 1/2 |w|' |d_i g'| |w| + |p_b| |d_i F_bj - d_j F_bi| |v_j|,  |S| |dF/dt v|

    Where the frame is nearly singular they exceed those of the machine, and their rounding is what is left of them.
    """
    w = basis.matrix @ machine.v
    size, momentum = ca.fabs(w), ca.fabs(basis.metric @ w)
    forces = [ca.dot(size, ca.fabs(partial_derivative(basis.metric, qi)) @ size) / 2 for qi in ca.vertsplit(machine.q)]
    for b, i, j, entry in curl(basis):
        forces[i] += momentum[b] * ca.fabs(entry * machine.v[j])
    return ca.vertcat(*forces), ca.fabs(basis.inverse) @ ca.fabs(ca.jtimes(w, machine.q, machine.v))


def effects_against_inverse_dynamics(kind: str) -> Iterator[Figure]:
    """Yield, for numbers folded in and random effects, what the torques of a form's motion differ by from its own.

    One figure for each form, in a random frame each time: inverse dynamics, evaluated in extended precision at the
    accelerations of the form, against the torques of the form.
    """
    random = np.random.default_rng([3, list(KINDS).index(kind)])
    results: dict[str, list[tuple[Array, Array]]] = {form: [] for form in FORMS}
    for _ in range(FOLDED):
        given = parameters(kind, random, random.uniform(0.0, 3.0))
        machine = KINDS[kind](**given)
        added = effects(random, len(machine.coordinates))
        points = states(machine, given, STATES, random)
        for form in FORMS:
            frames = [f for f in machine.frames if f != "paper"]
            results[form].append(residual(machine, added, form, str(random.choice(frames)), points, random))
    for form, parts in results.items():
        error, condition = (np.concatenate(column) for column in zip(*parts, strict=True))
        yield worst(error, condition, f"{form}, random frames: {error.size} states, {FOLDED} machines")


def residual(
    machine: Manipulator, added: list[Effect], form: str, frame: str, points: tuple[Array, Array, Array],
    random: np.random.Generator,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the relative errors (K,) of the torques, and the condition numbers (K,) of the metric and its frame."""
    q, v, tau = points
    count = q.shape[1]
    system, mechanics = FORMS[form](machine, added, frame), assemble(machine, added)
    basis = mechanics.frame(frame)
    begin = ca.Function("begin", [machine.q, machine.v], [initial(machine, form, basis)])
    others = random.normal(size=(system.x.numel() - 2 * len(q), count))  # states of drives
    x = np.vstack([np.array(begin.map(count)(q, v)), others])
    move = ca.Function("move", [system.x, system.u], [acceleration(system), system["tau"]])
    a, own = (np.array(part) for part in move.map(count)(x, tau))
    symbols = [ca.SX.sym(name, len(q)) for name in ("q", "v", "a")]
    torques = inverse_dynamics(machine, added)
    parts = [torques(*symbols, []), torques(symbols[0], symbols[1], 0, []), torques(symbols[0], 0, 0, [])]
    parts.append(ca.fabs(ca.jacobian(parts[-1], symbols[0])) @ ca.fabs(symbols[0]))
    needed, moved, held, tilted = (part[:, 0] for part in extended(symbols, parts, [q, v, a]))
    metric, matrix, inverse = extended([machine.q], [mechanics.metric, basis.matrix, basis.inverse], [q])
    weight = np.sqrt(np.array([metric[i, i] for i in range(len(q))]))
    forces = np.abs(own) + np.abs(moved - held) + np.abs(held) + tilted
    size = np.linalg.norm(weight * a, axis=0) + np.linalg.norm(forces / weight, axis=0)
    error = np.linalg.norm((needed - own) / weight, axis=0) / size
    # What effects add is pulled back to a frame made for the machine: S' M S, so its condition enters twice.
    skeel = np.einsum("ijk,jlk->kil", np.abs(weight[:, None] * inverse), np.abs(matrix / weight)).astype(float)
    return error.astype(float), condition_of(metric) * np.linalg.norm(skeel, 2, axis=(1, 2)) ** 2


def worst(error: Array, condition: Array, note: str) -> Figure:
    """Return the figure of the state whose error is the largest share of 1e3 eps cond; no number is the worst."""
    share = np.where(np.isfinite(error), error / condition, np.inf)
    k = int(np.argmax(share))
    return Figure(float(error[k]), MANY * EPS * float(condition[k]), condition=float(condition[k]), note=note)


CASES: tuple[Case, ...] = (
    *(
        Case("search", f"accelerations, {name}", "share of all forces", "", partial(forms_against_bodies, name), False)
        for name in WHOLE
    ),
    *(
        Case("search", f"power balance, {name}", "share of all powers", "", partial(balances, name), False)
        for name in WHOLE
    ),
    *(
        Case("search", f"random effects, {kind}", "share of all forces", "",
             partial(effects_against_inverse_dynamics, kind), False)
        for kind in KINDS
    ),
)  # fmt: skip
