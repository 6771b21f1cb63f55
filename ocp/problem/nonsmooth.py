"""Kinks of costs and constraints: how to find them, and exact reformulations without them.

|e| and max(e, 0) have no derivative at e = 0, and an NLP solver that meets the kink stops there. With a further control
s, s >= e and s >= -e (or s >= 0), the least s is |e| (or max(e, 0)): exact where s is minimised, and smooth.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from ocp import checks
from ocp.problem.problem import Problem
from ocp.system import Label, System

KINKS = {
    ca.OP_FABS: "fabs", ca.OP_FMAX: "fmax", ca.OP_FMIN: "fmin", ca.OP_IF_ELSE_ZERO: "if_else", ca.OP_SIGN: "sign",
    ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_FMOD: "fmod", ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==",
    ca.OP_NE: "!=",
}  # fmt: skip


def absolute(system: System, expression: ca.SX, name: str = "absolute") -> tuple[System, ca.SX]:
    """Return a system with further controls s >= |expression|, and s, which a cost takes in the place of |expression|.

    Exact where s is minimised or bounded from above. With constant controls s is constant on an element too, so it is
    the largest value there: exact for an expression that is constant as well, such as a control, else above it by an
    amount that halves with the width of the elements.

    Args:
        system: x' = f(x, u, p).
        expression: (m,) a signal of the system, or any expression in x, u, p.
        name: of the signal s, and of the two limits.

    Returns:
        The system, with the limits of s as its own, and s (m,).

    Raises:
        ValueError: symbols that the system does not have, or a name that it has already.
    """
    e = _column(system, expression, name)
    s = ca.SX.sym(name, e.numel())
    return _with_slack(system, s, name, {f"{name} - e": s - e, f"{name} + e": s + e}), s


def positive_part(system: System, expression: ca.SX, name: str = "positive_part") -> tuple[System, ca.SX]:
    """Return a system with further controls s >= max(expression, 0), and s; see `absolute`.

    Args:
        system: x' = f(x, u, p).
        expression: (m,) a signal of the system, or any expression in x, u, p, such as the power of a motor.
        name: of the signal s, and of its limits.

    Returns:
        The system, with the limits of s as its own, and s (m,).

    Raises:
        ValueError: symbols that the system does not have, or a name that it has already.
    """
    e = _column(system, expression, name)
    s = ca.SX.sym(name, e.numel())
    return _with_slack(system, s, name, {name: s, f"{name} - e": s - e}), s


def _column(system: System, expression: ca.SX, name: str) -> ca.SX:
    checks.instance("system", system, System, "a System")
    checks.text("name", name)
    checks.expression(name, expression)
    system.check_symbols(name, expression)
    if not name or name in system.signals:
        raise ValueError(f"name: got {name!r}, expected one that the signals of the system do not have")
    return ca.densify(ca.vec(expression))


def _with_slack(system: System, s: ca.SX, name: str, above_zero: dict[str, ca.SX]) -> System:
    own = system.label("u", system.u.numel())
    slack = (Label(name),) if s.numel() == 1 else tuple(Label(f"{name}_{i + 1}") for i in range(s.numel()))
    u, implicit = ca.vertcat(system.u, s), system.implicit
    if implicit is not None:
        implicit = implicit.extended((system.x, system.u), (system.x, u), system.p, ca.SX(0, 1))
    return replace(
        system,
        u=u,
        signals={**system.signals, name: s, **above_zero},
        labels={**system.labels, "u": (*own, *slack)},
        limits={**system.limits, **dict.fromkeys(above_zero, (0.0, None))},
        implicit=implicit,
    )


def kinks(problem: Problem) -> list[tuple[str, str]]:
    """Return where the functions of a problem have kinks or jumps in x or u: (name of the expression, CasADi function).

    Args:
        problem: a Problem.
    """
    system, cost = problem.system, problem.minimise
    parts = [("the running cost", cost.running), ("the final cost", cost.final), ("the initial cost", cost.initial)]
    labels = system.label("x", system.x.numel())
    parts += [(f"d{label.name}/dt", rate) for label, rate in zip(labels, ca.vertsplit(system.rate), strict=True)]
    for constraint in problem.subject_to:
        each = zip(problem.labels(constraint), ca.vertsplit(constraint.expression), strict=True)
        parts += [(label.name, component) for label, component in each]
    result = dict.fromkeys((name, kink) for name, part in parts for kink in _of(part, system))
    return list(result)


def _of(expression: ca.SX, system: System) -> list[str]:
    """Return the functions with kinks in an expression whose arguments depend on x or u."""
    if expression.is_constant() or not ca.depends_on(expression, ca.vertcat(system.x, system.u)):
        return []
    function = ca.Function("part", [ca.vertcat(*ca.symvar(expression))], [expression])
    variables = {s.element_hash() for s in ca.vertsplit(ca.vertcat(system.x, system.u))}
    moving = [s.element_hash() in variables for s in ca.symvar(expression)]
    work: dict[int, bool] = {}
    results = []
    for k in range(function.n_instructions()):
        operation, into, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_INPUT:
            work[into[0]] = moving[of[1]]
        elif operation == ca.OP_CONST:
            work[into[0]] = False
        elif operation != ca.OP_OUTPUT:
            moves = any(work.get(argument, False) for argument in of)
            if moves and operation in KINKS:
                results.append(KINKS[operation])
            work[into[0]] = moves
    return results
