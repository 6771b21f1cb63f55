"""Fields of effects: numbers with a unit, one for all drives or one for each, that may stay symbols."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from models.machines.manipulator import Manipulator
from models.machines.parameters import Parameter, Value, number
from models.mechanics.terms import Effect, Quantity, Terms, name_of
from ocp import checks

Entry = ca.SX | float  # number or symbol in the graph
Each = Value | Sequence[Value]  # one value for all drives, or one for each
Some = Value | Sequence[Value | None]  # the same, None for drives that have none


def quantity(
    unit: str,
    default: object = dataclasses.MISSING,
    above: float | None = None,
    at_least: float | None = None,
    scalar: bool = False,
) -> Any:
    """Return a dataclass field with a unit and a range.

    Args:
        unit: SI unit.
        default: default value; without one the field is required.
        above, at_least: the value must be > above, or >= at_least.
        scalar: whether it is one number, not one for each drive or component.
    """
    about = {"unit": unit, "above": above, "at_least": at_least, "scalar": scalar}
    return dataclasses.field(default=default, metadata=about)


@dataclass(frozen=True, eq=False)
class Fields:
    """Checked fields of one effect: numbers or symbols for the graph, and nominal values of the symbols."""

    prefix: str
    entries: Mapping[str, Entry | tuple[Entry | None, ...] | None]
    symbols: Mapping[str, ca.SX]
    nominal: Mapping[str, float]  # of the symbols

    def __getitem__(self, name: str) -> Any:
        return self.entries[name]

    def each(self, name: str, machine: Manipulator) -> tuple[Any, ...]:
        """Return one entry for each drive.

        Raises:
            ValueError: the field has another number of entries than the machine has drives.
        """
        value, drives = self.entries[name], [c.name for c in machine.coordinates]
        if not isinstance(value, tuple):
            return (value,) * len(drives)
        if len(value) != len(drives):
            raise ValueError(
                f"{self.prefix}.{name}: got {len(value)} values, {machine.name} has {len(drives)} drives "
                f"({', '.join(drives)}); give one value for all or one for each"
            )
        return value


def present(fields: Fields, name: str, drive: int, value: Any) -> Any:
    """Return the entry of a drive; raise if it is None although the other fields of this drive have numbers.

    Raises:
        ValueError: the drive has None there.
    """
    if value is None:
        raise ValueError(f"{fields.prefix}.{name}_{drive + 1}: got None, expected a number, as this drive has the rest")
    return value


def read_fields(effect: Effect, *names: str) -> Fields:
    """Check fields of an effect made by `quantity` and make symbols of those wrapped in `Parameter`.

    Args:
        effect: a dataclass.
        names: of the fields; all fields with a unit if empty.

    Raises:
        ValueError: a value is not a finite number (or not a list of them), or is out of its range.
    """
    prefix = name_of(effect)
    entries: dict[str, Entry | tuple[Entry | None, ...] | None] = {}
    symbols: dict[str, ca.SX] = {}
    nominal: dict[str, float] = {}

    def entry(name: str, value: object, about: Mapping[str, Any]) -> Entry:
        raw = number(name, value.value if isinstance(value, Parameter) else value, about["unit"])
        above, least = about["above"], about["at_least"]
        if (above is not None and raw <= above) or (least is not None and raw < least):
            wanted = f"> {above:g}" if above is not None else f">= {least:g}"
            raise ValueError(f"{name}: got {raw:g} {about['unit']}, expected a number {wanted}")
        if above == 0.0 and raw < checks.SMALLEST:
            raise checks.refused(name, raw, f"a number > 0, {checks.RANGE}")
        if not isinstance(value, Parameter):
            return raw
        nominal[name], symbols[name] = raw, ca.SX.sym(name)
        return symbols[name]

    for field in dataclasses.fields(effect):  # type: ignore[arg-type]
        if "unit" not in field.metadata or (names and field.name not in names):
            continue
        name, value = f"{prefix}.{field.name}", getattr(effect, field.name)
        several = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim == 1)
        if several and not field.metadata["scalar"]:
            if len(value) == 0:
                raise ValueError(f"{name}: got no values, expected one for all drives or one for each")
            entries[field.name] = tuple(
                None if item is None else entry(f"{name}_{i + 1}", item, field.metadata) for i, item in enumerate(value)
            )
        elif value is None and field.default is None:
            entries[field.name] = None
        else:
            entries[field.name] = entry(name, value, field.metadata)
    return Fields(prefix, entries, symbols, nominal)


def names_of(machine: Manipulator, prefix: str, chosen: Sequence[int] | None = None) -> tuple[str, ...]:
    """Return the names prefix_coordinate of all drives, or of the chosen ones."""
    indices = range(len(machine.coordinates)) if chosen is None else chosen
    return tuple(f"{prefix}_{machine.coordinates[i].name}" for i in indices)


def units_of(machine: Manipulator, suffix: str = "", force: bool = False) -> tuple[str, ...]:
    """Return the unit of every coordinate, or of the force along it, with a suffix such as "/s"."""
    return tuple((c.force_unit if force else c.unit) + suffix for c in machine.coordinates)


def bounded(
    name: str,
    expression: ca.SX,
    limit: Sequence[Entry | None],
    components: tuple[str, ...],
    unit: str | tuple[str, ...],
    both: bool = True,
) -> Terms:
    """Return Terms with a limit |component| <= limit of a signal; if a limit is a symbol, of signal / limit instead.

    Args:
        name: of the signal; `name`_share for the share.
        expression: (m,) the signal.
        limit: (m,) numbers or symbols, None for no limit.
        components: (m,) names.
        unit: of the signal, one for all components or one for each.
        both: whether the limit applies to both signs.
    """
    numbers = [float("inf") if value is None else value for value in limit]
    if all(value is None for value in limit):
        return Terms()
    if not any(isinstance(value, ca.SX) for value in numbers):
        upper = np.array(numbers, dtype=float)
        sides = (-upper if both else None, upper)
        return Terms(signals={name: Quantity(expression, unit, components)}, limits={name: sides})
    kept = [i for i, value in enumerate(limit) if value is not None]
    share = ca.vertcat(*(expression[i] / numbers[i] for i in kept))
    names = tuple(f"{components[i]}_share" for i in kept)
    name = f"{name}_share"
    return Terms(signals={name: Quantity(share, "1", names)}, limits={name: (-1.0 if both else None, 1.0)})
