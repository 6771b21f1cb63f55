"""Drawing of a manipulator: coordinates with their axes and positive directions, zero position, bodies, tool."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.axes3d import Axes3D

from models.machines.manipulator import Manipulator
from models.plots.signals import skeleton
from models.plots.space import bounds, frame_of
from models.plots.style import ACCENT, CLEAR, FAINT, MOTION, File, pretty, saved
from ocp import checks
from ocp.checks import Array

TYPICAL = 0.6  # [rad or m] of every coordinate in a drawing without a position
TURN = np.linspace(0.0, 1.5 * np.pi, 40)  # of a circular arrow
MIDDLE = 0.75 * np.pi  # of the arrow, where its name stands
STILL = 1e-9
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d1f", "#6b6bb0")


@dataclass(frozen=True, eq=False)
class Axis:
    """How the bodies beyond a joint move when its coordinate grows."""

    turns: bool  # about the axis, or along it
    direction: Array  # (3,) unit vector; a positive rotation is right-handed about it
    point: Array  # (3,) on the axis [m]


def machine(arm: Manipulator, q: Array | None = None, path: File | None = None) -> Figure:
    """Draw a manipulator with its coordinates, derived from the motion of its bodies.

    Args:
        arm: any manipulator.
        q: (n,) position to draw [rad or m]; None: 0.6 for every coordinate.
        path: of the picture (.png, .svg, .pdf); None leaves the figure open.

    Raises:
        ValueError: q has another length.
        OSError: the file cannot be written.
    """
    n = len(arm.coordinates)
    pose = np.full(n, TYPICAL) if q is None else checks.column("q", q, n, f"{n} finite numbers in rad or m")
    corners = skeleton(arm, np.vstack([pose, np.zeros(n)]))
    middle, half = bounds(np.concatenate([corners, np.zeros((1, *corners.shape[1:]))]))
    figure = plt.figure(figsize=(8.2, 7.8), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    for k, name in enumerate("xyz"):
        tip = 0.35 * half * np.eye(3)[k]
        axes.quiver(0, 0, 0, *tip, color="black", linewidth=1.0, arrow_length_ratio=0.12)
        axes.text(*(1.12 * tip), f"$e_{k + 1}$" + (" up" if name == "z" else ""), fontsize=9, bbox=CLEAR)
    axes.plot(*corners[1].T, "--o", color=FAINT, linewidth=1.6, markersize=3)
    axes.plot(*corners[0].T, "-o", color=MOTION, linewidth=3.2, markersize=4)
    axes.plot(*corners[0][-1:].T, "s", color=ACCENT, markersize=8)
    axes.text(*(corners[0][-1] - 0.12 * half * np.eye(3)[2]), "tool", fontsize=10, ha="center", va="top", bbox=CLEAR)
    for body, centre in centres(arm, pose).items():
        axes.plot(*centre[:, None], "x", color=MOTION, markersize=6)
        axes.text(*centre, f"  {body}", fontsize=8, color=MOTION)
    handles = [
        Line2D([], [], color=MOTION, marker="o", label="position drawn: " + _listed(arm, pose)),
        Line2D([], [], color=FAINT, linestyle="--", marker="o", label="zero position: every coordinate 0"),
    ]
    for k, (axis, c) in enumerate(zip(joint_axes(arm, pose), arm.coordinates, strict=True)):
        if axis is not None:
            _arrow(axes, axis, corners[0], half, COLOURS[k % len(COLOURS)], pretty(c.name))
        way = (
            "does not move a body" if axis is None else "turns about its axis" if axis.turns else "moves along its axis"
        )
        label = (
            f"{pretty(f'{c.name} [{c.unit}]')}: {way}; drive {pretty(f'tau_{c.name} [{c.force_unit}]')} in its sense"
        )
        handles.append(Line2D([], [], color=COLOURS[k % len(COLOURS)], marker=">", label=label))
    frame_of(axes, middle, half, zoom=1.12)
    axes.view_init(elev=22.0, azim=-58.0)
    figure.legend(handles=handles, loc="outside lower center", fontsize=9, frameon=False)
    figure.suptitle(f"The {arm.name} manipulator: coordinates and positive directions", fontsize=11)
    return saved(figure, path)


def joint_axes(arm: Manipulator, q: Array) -> list[Axis | None]:
    """Return the axis of every coordinate at q (n,), in the base frame; None for one that moves no body.

    With dR/dq R' the rotation per unit of the coordinate of the first body that it moves, and dr/dq the shift of its
    mass centre: a rotation about the line through r + omega x dr/dq / |omega|^2, or a shift along dr/dq.
    """
    outputs = []
    for body in arm.bodies:
        turned = [ca.reshape(ca.jacobian(ca.vec(body.orientation), c), 3, 3) for c in ca.vertsplit(arm.q)]
        spins = ca.horzcat(*(_axial(slope @ body.orientation.T) for slope in turned))
        outputs += [ca.densify(spins), ca.densify(ca.jacobian(body.centre, arm.q)), ca.densify(body.centre)]
    values = [np.array(part) for part in _function(arm, outputs)(q)]
    results: list[Axis | None] = []
    for k in range(len(arm.coordinates)):
        results.append(None)
        for spin, shift, centre in zip(values[::3], values[1::3], values[2::3], strict=True):
            omega, v = spin[:, k], shift[:, k]
            if np.linalg.norm(omega) > STILL:
                results[-1] = Axis(
                    True, omega / np.linalg.norm(omega), centre[:, 0] + np.cross(omega, v) / (omega @ omega)
                )
            elif np.linalg.norm(v) > STILL:
                results[-1] = Axis(False, v / np.linalg.norm(v), centre[:, 0])
            else:
                continue
            break
    return results


def centres(arm: Manipulator, q: Array) -> dict[str, Array]:
    """Return the mass centres (3,) of the bodies that have a mass, by name [m]."""
    heavy = [body for body in arm.bodies if not (isinstance(body.mass, int | float) and body.mass == 0.0)]
    values = _function(arm, [ca.densify(body.centre) for body in heavy])(q)
    values = values if isinstance(values, tuple) else (values,)
    return {body.name: np.array(value).ravel() for body, value in zip(heavy, values, strict=True)}


def _function(arm: Manipulator, outputs: list[ca.SX]) -> ca.Function:
    """Return a function of q with the parameters that are symbols at their nominal values."""
    symbols = list(arm.symbols.values())
    if symbols:
        numbers = ca.vertcat(*(arm.nominal[name] for name in arm.symbols))
        outputs = ca.substitute(outputs, [ca.vertcat(*symbols)], [numbers])
    return ca.Function("drawing", [arm.q], outputs)


def _axial(matrix: ca.SX) -> ca.SX:
    """Return the vector of the skew-symmetric part of a matrix (3, 3)."""
    return ca.vertcat(matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]) / 2


def _arrow(axes: Axes3D, axis: Axis, corners: Array, half: float, colour: str, label: str) -> None:
    """Draw an axis through the corner of the arm that is nearest to it, and an arrow around or along it."""
    away = corners - axis.point
    along = away @ axis.direction
    gaps = np.linalg.norm(away - np.outer(along, axis.direction), axis=1)
    nearest = int(np.flatnonzero(gaps <= gaps.min() + 1e-6 * half)[-1])
    foot = axis.point + along[nearest] * axis.direction
    ends = np.stack([foot - 0.3 * half * axis.direction, foot + 0.3 * half * axis.direction])
    axes.plot(*ends.T, color=colour, linewidth=1.0, linestyle="-.")
    if not axis.turns:
        axes.quiver(*foot, *(0.4 * half * axis.direction), color=colour, linewidth=2.4, arrow_length_ratio=0.25)
        axes.text(*(foot + 0.46 * half * axis.direction), label, color=colour, fontsize=12)
        return
    helper = np.eye(3)[int(np.argmin(np.abs(axis.direction)))]
    one = np.cross(axis.direction, helper)
    one /= np.linalg.norm(one)
    other = np.cross(axis.direction, one)
    centre = foot + 0.22 * half * axis.direction
    ring = centre + 0.13 * half * (np.outer(np.cos(TURN), one) + np.outer(np.sin(TURN), other))
    axes.plot(*ring.T, color=colour, linewidth=2.2)
    axes.quiver(*ring[-1], *(4.0 * (ring[-1] - ring[-2])), color=colour, linewidth=2.2, arrow_length_ratio=0.9)
    outside = np.cos(MIDDLE) * one + np.sin(MIDDLE) * other
    axes.text(*(centre + 0.21 * half * outside), label, color=colour, fontsize=12, ha="center", va="center", bbox=CLEAR)


def _listed(arm: Manipulator, q: Array) -> str:
    return ", ".join(f"{c.name} = {value:.3g} {c.unit}" for c, value in zip(arm.coordinates, q, strict=True))
