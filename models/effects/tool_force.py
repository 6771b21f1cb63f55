"""A force or a wrench at the tool."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from models.effects.effect_fields import Fields, quantity, read_fields
from models.machines.body_metrics import angular_velocity, simplified
from models.machines.manipulator import Manipulator
from models.machines.parameters import Value
from models.mechanics.contributions import Sizes
from models.mechanics.terms import Read, Terms, name_of
from ocp import checks

Vector = Sequence[Value] | Callable[..., Sequence[ca.SX | float] | ca.SX]
# Components of the signals that every machine has; None for one for each joint.
SIZES = {"time": 1, "tool": 3, "tool_v": 3, "q": None, "v": None, "tau": None, "motor_q": None, "motor_v": None}


@dataclass(frozen=True)
class ToolForce:
    """A force F at the tool point and a moment M on the last body, Q = J_tool' F + J_turn' M.

    J_tool = d r_tool / dq, J_turn v the angular velocity of the last body. F and M are constants, or functions of the
    time or of signals: a CasADi Function, or any function of CasADi symbols that returns three expressions.

    Adds a force, and minus its power to the signal "loss"; a function of the time also a clock, the state `time` with
    the rate 1 [s]; no controls, the parameters `tool_force.force_1`, ... if they are Parameters.

    Args:
        force: (3,) F, or a function that returns it [N].
        moment: (3,) M, or a function that returns it [N m].
        of: names of the signals that the functions are called with, in order: "time", "q", "v", "tool" (position),
            "tool_v" (velocity), "motor_q", "motor_v", or a scalar signal or state of another effect.
        in_tool_axes: whether F and M are components in the axes of the last body instead of the inertial frame.

    Raises:
        ValueError: not three finite numbers, a function that does not return three expressions in its arguments, or a
            signal that nobody defines.
    """

    force: Vector = quantity("N", (0.0, 0.0, 0.0))
    moment: Vector = quantity("N m", (0.0, 0.0, 0.0))
    of: tuple[str, ...] = ("time",)
    in_tool_axes: bool = False

    def __post_init__(self) -> None:
        for name in ("force", "moment"):
            value = getattr(self, name)
            if not callable(value) or isinstance(value, type):
                wanted = "three numbers or a function"
                several = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)
                if not several or len(value) != 3 or any(part is None for part in value):
                    raise checks.refused(f"tool_force.{name}", value, wanted)
                read_fields(self, name)
        checks.truth("tool_force.in_tool_axes", self.in_tool_axes)
        of = (self.of,) if isinstance(self.of, str) else self.of
        if not isinstance(of, tuple | list) or not of or not all(isinstance(name, str) and name for name in of):
            raise checks.refused("tool_force.of", self.of, "the names of signals, such as ('time',)")
        object.__setattr__(self, "of", tuple(of))

    @classmethod
    def typical(cls, sizes: Sizes) -> ToolForce:
        """Return a force of 50 N downwards."""
        return cls((0.0, 0.0, -50.0))

    def __call__(self, machine: Manipulator, so_far: Terms) -> Terms:
        """Return the generalised force."""
        constant = [name for name in ("force", "moment") if not callable(getattr(self, name))]
        fields = read_fields(self, *constant) if constant else Fields(name_of(self), {}, {}, {})
        sizes = [SIZES.get(name, 1) or machine.q.numel() for name in self.of]
        arguments = [ca.SX.sym(name, size) for name, size in zip(self.of, sizes, strict=True)]
        axes, generalised = machine.tool_orientation, ca.SX(machine.q.numel(), 1)
        for name in ("force", "moment"):
            vector = ca.SX(ca.vertcat(*fields[name])) if name in constant else self._called(name, arguments)
            vector = ca.sparsify(vector)
            if vector.nnz() == 0:
                continue
            # In the axes of the last body; turned back if the components are inertial.
            if name == "force":
                slope = ca.jacobian(machine.tool, machine.q)
                slope = simplified(axes.T @ slope if self.in_tool_axes else slope, machine.q)
            else:
                slope = angular_velocity(axes, machine.q)
                slope = slope if self.in_tool_axes else simplified(axes @ slope, machine.q)
            generalised += slope.T @ vector
        used = ca.symvar(generalised)
        read = [
            Read(name, symbol, fields.prefix, f"an effect that defines {name!r}")
            for name, symbol in zip(self.of, arguments, strict=True)
            if any(ca.is_equal(part, other) for part in ca.vertsplit(symbol) for other in used)
        ]
        return Terms(
            force=generalised if generalised.nnz() else None,
            reads=tuple(read), symbols=fields.symbols, nominal=fields.nominal,
        )  # fmt: skip

    def _called(self, name: str, arguments: list[ca.SX]) -> ca.SX:
        try:
            returned = getattr(self, name)(*arguments)
            vector = returned if isinstance(returned, ca.SX) else ca.SX(ca.vertcat(*returned))
        except Exception as error:
            reason = checks.shown(str(error).split("\n", 1)[0])
            raise ValueError(
                f"tool_force.{name}: the function of {', '.join(self.of)} failed ({reason}), expected one that returns "
                "three expressions"
            ) from error
        known = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(*arguments))}
        if vector.numel() != 3 or any(symbol.element_hash() not in known for symbol in ca.symvar(vector)):
            raise ValueError(
                f"tool_force.{name}: the function returned {vector}, expected three expressions in {', '.join(self.of)}"
            )
        return ca.vec(vector)
