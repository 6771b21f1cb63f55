"""Summary of a torque table: printed for people, and as plain data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from models import Motion, Scene, TorqueTable
from models.torques.limit_check import broken_limits
from models.torques.shaft import RPM, cubic_mean, moving_share
from models.torques.time_means import rms_of_samples
from reports.fastest_path import Limits

POSITIONS = ("motor_q", "motor_v")  # quantities of drives that are no loads
SHOWN = 4  # intervals of one limit that are printed
Say = Callable[[str], None]
Account = dict[str, object]


def describe(say: Say, motion: Motion, table: TorqueTable, scene: Scene, limits: Limits, compare: bool) -> Account:
    """Print the summary of a torque table and return it as plain data.

    Args:
        say: called with each line.
        motion: of the table.
        table: with its limits.
        scene: machine and effects.
        limits: of the scene, on signals.
        compare: whether raw differences of the samples are compared with.
    """
    rows = table.resolved
    for note in rows.notes:
        say(f"note: {note}")
    say(str(table))
    account: Account = {
        "machine": table.machine.name,
        "effects": [repr(effect) for effect in table.effects],
        "start": motion.start,
        "end": motion.end,
        "rows": len(table.t),
        "resolved_rows": len(rows.t),
        "smoothness": motion.smoothness if np.isfinite(motion.smoothness) else None,
        "notes": list(rows.notes),
        "drives": [asdict(drive) for drive in table.loads],
        "split_rms": {name: rows.rms(part).tolist() for name, part in rows.split.items()},
    }
    names = [c.name for c in table.machine.coordinates]
    units = [c.force_unit for c in table.machine.coordinates]
    say("rms of the parts of the torques")
    _print(say, ["part", *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))],
           [[name, *_row(rows.rms(part))] for name, part in rows.split.items()])  # fmt: skip
    _drives(say, account, rows, scene)
    _noise(say, account, motion, rows)
    if compare:
        apart = rms_of_samples(table.t, raw_torques(motion, table) - table.tau)
        say(f"raw          differences of the samples would be off by {', '.join(_row(apart))} (rms)")
        account["raw_difference_rms"] = apart.tolist()
    account["broken_limits"] = [asdict(span) for span in broken_limits(table, limits)]
    for line in exceeded(table, limits):
        say(f"exceeded     {line}")
    return account


def raw_torques(motion: Motion, table: TorqueTable) -> np.ndarray:
    """Return the torques (K, n) that raw second differences of the samples would give."""
    return motion.differenced().torques(table.machine, table.effects, times=table.t).tau


def exceeds(account: Account) -> bool:
    """Whether any limit is exceeded."""
    drives: list[dict[str, object]] = account["drives"]  # type: ignore[assignment]
    return bool(account["broken_limits"]) or any(drive["exceeded"] or drive["overheated"] for drive in drives)


def plain(value: object) -> object:
    """Return data that JSON can hold: None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _drives(say: Say, account: Account, rows: TorqueTable, scene: Scene) -> None:
    """Add the quantities of the drives, and those at the shafts of the motors."""
    account["drive_side"], account["shaft"] = {}, {}
    try:
        needs = {name: part for name, part in rows.drives.items() if name not in POSITIONS}
        shaft = rows.shaft
    except ValueError as error:
        say(f"note: {error}")
        return
    sizes = {name: {"peak": _peak(part).tolist(), "rms": rows.rms(part).tolist()} for name, part in needs.items()}
    account["drive_side"] = sizes
    names = [c.name for c in rows.machine.coordinates]
    if any(name != "motor_tau" or not np.array_equal(part, rows.tau) for name, part in needs.items()):
        say("motors, in units of the joints: peak, rms")
        lines = []
        for name, part in needs.items():
            unit = scene.system.label(name, part.shape[1])[0].unit or "N m or N"
            both = [f"{p:.4g}, {r:.4g}" for p, r in zip(_peak(part), rows.rms(part), strict=True)]
            lines.append([f"{name} [{unit}]", *both])
        _print(say, ["", *names], lines)
    if shaft is None:
        return
    figures = {
        "ratio": shaft.ratio,
        "peak torque [N m]": _peak(shaft.torque),
        "rms torque [N m]": rows.rms(shaft.torque),
        "cubic mean torque [N m]": cubic_mean(rows.t, shaft.torque, shaft.speed),
        "peak speed [1/min]": _peak(shaft.rpm),
        "mean speed [1/min]": np.trapezoid(np.abs(shaft.speed), rows.t, axis=0) / (rows.t[-1] - rows.t[0]) * RPM,
        "peak power [W]": np.max(shaft.power, axis=0),
        "moving [% of the time]": 100.0 * moving_share(rows.t, shaft.speed),
    }
    account["shaft"] = {name: values.tolist() for name, values in figures.items()}
    say("at the shafts of the motors")
    _print(say, ["", *names], [[name, *_row(values)] for name, values in figures.items()])


def _noise(say: Say, account: Account, motion: Motion, rows: TorqueTable) -> None:
    smoothed, uncertainty = motion.smoothed, rows.uncertainty
    if smoothed is None or uncertainty is None:
        return
    say(f"noise        {', '.join(_row(smoothed.noise))} (rad or m), residual {', '.join(_row(smoothed.residual))}")
    say(f"uncertainty  of the torques {', '.join(_row(rows.rms(uncertainty)))} (rms of the standard deviation)")
    account["noise"], account["residual"] = smoothed.noise.tolist(), smoothed.residual.tolist()
    account["uncertainty_rms"] = rows.rms(uncertainty).tolist()


def exceeded(table: TorqueTable, limits: Limits | None = None) -> list[str]:
    """Return sentences about the intervals in which limits are exceeded, the first ones of each limit.

    Args:
        table: with the limits of its drives.
        limits: further ones, on signals.
    """
    lines: dict[str, list[str]] = {}
    for drive in table.loads:
        lines[drive.name] = [
            f"{drive.name} from {span.start:.6g} to {span.end:.6g} s, up to {span.ratio:.4g} times"
            for span in drive.exceeded
        ]
        if drive.overheated:
            lines[f"{drive.name} rms"] = [
                f"{drive.name}: the root mean square {drive.rms:.5g} {drive.unit} is beyond its limit"
            ]
    for where in broken_limits(table, limits):
        when = f"from {where.start:.6g} to {where.end:.6g} s"
        several = lines.setdefault(f"{where.name} {where.limit}", [])
        several.append(f"{where.name} {when}: {where.value:.4g}, the limit is {where.limit:.4g}")
    shown = []
    for several in lines.values():
        shown += several[:SHOWN]
        if len(several) > SHOWN:
            shown.append(f"... and in {len(several) - SHOWN} more intervals, see torques.json")
    return shown


def _print(say: Say, header: list[str], lines: list[list[str]]) -> None:
    """Print lines in columns, numbers to the right."""
    cells = [header, *lines]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        say("  " + "   ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]))


def _peak(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(values), axis=0))


def _row(values: np.ndarray) -> list[str]:
    return [f"{x:.4g}" for x in values]
