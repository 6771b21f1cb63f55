"""Motions given as functions of the time."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp import checks
from ocp.checks import Array
from ocp.numerics.evaluation import evaluate

ORDERS = 6  # derivatives of order 0 .. 5 are formed


@dataclass(frozen=True, eq=False)
class ExpressionCurve:
    """q(t) as a CasADi function; its derivatives are those of the graph, exact."""

    derivatives: tuple[ca.Function, ...]

    @classmethod
    def of(cls, q: object) -> ExpressionCurve:
        """Form the derivatives.

        Args:
            q: a CasADi Function t -> (n,), or a Python function that maps a symbol t to n expressions or numbers.

        Raises:
            TypeError: neither, or the function cannot be called with a symbol.
            ValueError: q depends on more than t.
        """
        t = ca.SX.sym("t")
        if isinstance(q, ca.Function):
            value = q(t)
        elif callable(q):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", FutureWarning)  # of numpy functions of a symbol, as meant here
                    value = q(t)
            except Exception as error:  # whatever a function of floats raises for a symbol
                raise TypeError(
                    f"q: the function cannot be called with a CasADi symbol ({checks.shown(error)}); "
                    "write it with casadi.sin ... or numpy.sin ..., or give v and a as functions too"
                ) from None
        else:
            raise TypeError(f"q: got {checks.shown(q)}, expected a function of t or a CasADi Function")
        if isinstance(value, list | tuple | np.ndarray):
            value = ca.vertcat(*np.ravel(np.array(value, dtype=object)).tolist())
        column = ca.densify(ca.vec(ca.SX(value)))
        if any(part.is_constant() and not np.isfinite(float(part)) for part in ca.vertsplit(column)):
            raise TypeError(
                "q: the function gives no finite expression of a CasADi symbol; write it with casadi.sin ... or "
                "numpy.sin ..., or give v and a as functions too"
            )
        foreign = [str(symbol) for symbol in ca.symvar(column) if symbol.element_hash() != t.element_hash()]
        if foreign:
            raise ValueError(f"q: depends on {', '.join(foreign)} beside t")
        functions = []
        for order in range(ORDERS):
            functions.append(ca.Function(f"q_{order}", [t], [ca.densify(column)]))
            column = ca.jacobian(column, t)
        return cls(tuple(functions))

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        return evaluate(self.derivatives[order], t[:, None])[0]


@dataclass(frozen=True, eq=False)
class FunctionCurve:
    """q, v and a as functions of numbers."""

    functions: tuple[Callable[[Array], Array], ...]

    def __call__(self, t: Array, order: int) -> Array:
        """Return the derivative of the given order (K, n) at times (K,)."""
        if order >= len(self.functions):
            raise ValueError("the jerk of this motion is not given")
        value = np.asarray(self.functions[order](t), dtype=float)
        value = value[:, None] if value.ndim == 1 else value
        if value.ndim != 2 or len(value) != len(t):
            raise ValueError(f"a function of {len(t)} times returned the shape {value.shape}, expected ({len(t)}, n)")
        return value
