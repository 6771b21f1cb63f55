"""Switching structure of a motion: which control is at which bound on which arc."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from ocp import checks


class Kind(Enum):
    """Role of a control or a state limit on an arc; the value is what tables show."""

    LOWER = "lower"  # control at its lower limit
    UPPER = "upper"  # control at its upper limit
    INTERIOR = "interior"  # control between its limits, determined by optimality
    HOLDING = "holding"  # control between its limits, determined by an active state limit
    LIMIT = "limit"  # state limit active along an arc
    TOUCH = "touch"  # state limit active at one instant

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Contact:
    """An active state limit: its index in `state_limits(problem)`, and which side."""

    limit: int
    side: int  # -1 lower, 1 upper
    control: int = -1  # index of the control that keeps it active along an arc; -1: at an instant, or no single one


@dataclass(frozen=True)
class Arc:
    """A part of the motion without a switch.

    Args:
        kinds: of every control.
        held: state limits active along the arc.
        touched: state limits active only at the instant where the arc begins.
        duration: [s].
    """

    kinds: tuple[Kind, ...]
    duration: float
    held: tuple[Contact, ...] = ()
    touched: tuple[Contact, ...] = ()

    def same(self, other: Arc) -> bool:
        """Return whether the other arc continues this one without a switch or touch point."""
        return self.kinds == other.kinds and self.held == other.held and not other.touched


class Row(NamedTuple):
    """One line of the table of a structure."""

    name: str  # of the control or the limited state
    kind: Kind
    start: float  # [s]
    end: float  # [s]; equal to start for a touch


@dataclass(frozen=True)
class Structure:
    """The switching structure of a solution, control by control; iterating yields its rows.

    Args:
        rows: of all controls, then of all state limits that become active.
        arcs: the same as arcs in order of time.
    """

    rows: tuple[Row, ...]
    arcs: tuple[Arc, ...]

    def __iter__(self) -> Iterator[Row]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: int) -> Row:
        return self.rows[index]

    def switches(self, name: str) -> tuple[float, ...]:
        """Return the times at which the kind of a control changes [s].

        Raises:
            ValueError: no such control or limit in the table.
        """
        checks.text("row", name, "the name of a control or a limit in the table")
        own = [row for row in self.rows if row.name == name]
        if not own:
            raise ValueError(f"no row {name!r}; there are {', '.join(dict.fromkeys(row.name for row in self.rows))}")
        return tuple(row.start for row in own[1:])

    def __str__(self) -> str:
        width = max(len(row.name) for row in self.rows)
        lines = [f"{'':{width}s}  kind      from [s]        to [s]"]
        before = ""
        for row in self.rows:
            shown = row.name if row.name != before else ""
            lines.append(f"{shown:{width}s}  {row.kind!s:8s}  {row.start:<14.10g}  {row.end:<14.10g}".rstrip())
            before = row.name
        return "\n".join(lines)
