"""Gear ratios and motors for the drives of a motion: a table for people, and rows for a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from models import Sizing, TorqueTable, size_gears
from models.scenes.motor_file import GearedMotor

SHOWN = 6  # best choices of a drive that are printed
STEPS = 17  # ratios of a range without a step
HEADER = ["motor", "ratio", "peak [N m]", "rms [N m]", "speed [1/min]", "power [W]", "inertia match", "rms [A]",
          "peak used", "rms used", "speed used", "fits"]  # fmt: skip
Say = Callable[[str], None]


def ratios_of(text: str) -> list[float]:
    """Return gear ratios from a text: 60:140 (17 of them), 60:140:10 (in steps of 10), or 50,80,100.

    Raises:
        ValueError: another text.
    """
    try:
        if ":" in text:
            ends = [float(part) for part in text.split(":")]
            if len(ends) not in (2, 3) or not 0.0 < ends[0] <= ends[1] or (len(ends) == 3 and ends[2] <= 0.0):
                raise ValueError
            if len(ends) == 2:
                return [float(x) for x in np.linspace(ends[0], ends[1], STEPS if ends[0] < ends[1] else 1)]
            count = int((ends[1] - ends[0]) / ends[2] + 1e-9) + 1
            return [ends[0] + k * ends[2] for k in range(min(count, 10_000))]
        ratios = [float(part) for part in text.split(",")]
        if not all(0.0 < ratio < np.inf for ratio in ratios):
            raise ValueError
    except ValueError:
        raise ValueError(f"--ratios: got {text!r}, expected 60:140, 60:140:10 or 50,80,100") from None
    return ratios


def sweep(
    table: TorqueTable, motors: Mapping[int, GearedMotor], catalogue: Sequence[GearedMotor], ratios: Sequence[float]
) -> dict[str, tuple[Sizing, ...]]:
    """Return the choices for every drive, best first, by its name.

    Args:
        table: of the motion.
        motors: of the drives, by index.
        catalogue: candidates for every drive, beside its own motor.
        ratios: gear ratios.

    Raises:
        ValueError: no motors at all.
    """
    if not motors and not catalogue:
        raise ValueError("--ratios: no motor; give [motors] in the scene, or --motors with a catalogue")
    results = {}
    for i, c in enumerate(table.machine.coordinates):
        own = [motors[i]] if i in motors else []
        candidates = [one for one in (*own, *catalogue) if one is not None]
        choices: list[Sizing] = []
        for efficiency in sorted({one.efficiency for one in candidates}):
            same = [one.motor for one in candidates if one.efficiency == efficiency]
            choices += size_gears(table, i, same, ratios, efficiency)
        if choices:
            results[c.name] = tuple(sorted(choices, key=lambda one: one.load))
    return results


def tell(say: Say, choices: Mapping[str, Sequence[Sizing]]) -> None:
    """Print the best choices for every drive."""
    for name, several in choices.items():
        fits = sum(one.load <= 1.0 for one in several)
        say(f"gears of {name}: {fits} of {len(several)} choices fit; the best, by the largest share that is used")
        cells = [HEADER, *([_text(value) for value in row(one)] for one in several[:SHOWN])]
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        for line in cells:
            say("  " + "   ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])]))


def row(one: Sizing) -> list[object]:
    """Return a choice as a row under HEADER."""
    peak, mean, speed = one.shares
    return [one.motor.name, one.ratio, one.peak, one.rms, one.rpm, one.power, one.match, one.current, peak, mean, speed,
            "yes" if one.load <= 1.0 else "no"]  # fmt: skip


def plain_rows(choices: Mapping[str, Sequence[Sizing]]) -> dict[str, list[dict[str, object]]]:
    """Return the choices as plain data."""
    return {name: [dict(zip(HEADER, row(one), strict=True)) for one in several] for name, several in choices.items()}


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    number = float(value)  # type: ignore[arg-type]
    return "-" if np.isnan(number) else f"{number:.4g}"
