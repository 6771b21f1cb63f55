"""Colours, labels and files of all pictures."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp.numerics.files import written_whole

MOTION, LIMIT, FAINT, ACCENT = "#1f4e79", "#b03a2e", "#9aa5b1", "#d98c1f"
OBSTACLE = "#7d6b5d"
CLEAR = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}  # behind words in a picture in space
GRID = "#e5e8eb"
GREEK = ("theta", "psi", "phi", "xi")
File = str | os.PathLike[str]


def saved(figure: Figure, path: File | None, dpi: int = 150) -> Figure:
    """Write a figure to a file and close it; without a path the figure stays open, for a notebook or plt.show().

    Args:
        figure: of matplotlib.
        path: of the picture, or None; the suffix chooses the format (.png, .svg, .pdf). An existing file is replaced
            when the new one is complete.
        dpi: dots per inch of a PNG.

    Raises:
        OSError: the file cannot be written.
    """
    if path is not None:
        try:
            # Fonts as outlines that every printer and publisher takes, instead of Type 3.
            with written_whole(Path(path)) as part, plt.rc_context({"pdf.fonttype": 42}):
                figure.savefig(part, dpi=dpi)
        finally:
            plt.close(figure)
    return figure


def styled(axes: Axes, label: str, title: str = "", x: str = "", log: bool = False) -> None:
    """Give axes their labels, small ticks and a faint grid.

    Args:
        axes: of one panel.
        label: of the vertical axis.
        title: above the panel.
        x: label of the horizontal axis; "" for a panel above others, which shares theirs.
        log: whether the vertical axis is logarithmic.
    """
    axes.set_ylabel(label, fontsize=9)
    axes.set_title(title, fontsize=10)
    axes.tick_params(labelsize=8, labelbottom=bool(x))
    axes.grid(visible=True, color=GRID, linewidth=0.6)
    axes.margins(x=0.01)
    if log:
        axes.set_yscale("log")
    else:
        axes.locator_params(axis="y", nbins=5)
    if x:
        axes.set_xlabel(x, fontsize=9)


def pretty(label: str) -> str:
    """Return a label such as "dtheta/dt [rad/s]" with its letters as mathematics."""
    name, _, unit = label.partition(" ")
    dotted = name.startswith("d") and name.endswith("/dt")
    name = name[1:-3] if dotted else name
    head, _, tail = name.partition("_")
    tail, digit = (tail[:-1], tail[-1]) if tail[-1:].isdigit() else (tail, "")
    if not tail and head[-1:].isdigit():
        head, digit = head[:-1], head[-1]
    if len(head) > 1 and head not in (*GREEK, "tau") and len(tail) > 1 and tail not in GREEK:
        head, tail, digit = f"{head}_{tail}{digit}", "", ""  # a name of several words, such as shoulder_pan_joint
    # Only whole words are letters: "axis" has no xi, and an underscore in a name of several words is no index.
    head, tail = (rf"\{word}" if word in GREEK or word == "tau" else word for word in (head, tail))
    head, tail = (word.replace("_", r"\_") for word in (head, tail))
    words = not tail.startswith("\\") and len(tail) > 1  # a name such as "elbow" stays upright
    index = rf"\mathrm{{{tail}}}" if words else tail
    index = f"{index}_{digit}" if index and digit else index + digit
    whole = len(head) > 1 and not head.startswith("\\")
    head = rf"\mathrm{{{head}}}" if whole else head
    if dotted and whole:  # a dot above a word is lost in it
        return f"d ${head}_{{{index}}}$/dt {unit}" if index else f"d ${head}$/dt {unit}"
    head = rf"\dot{{{head}}}" if dotted else head
    return f"${head}_{{{index}}}$ {unit}" if index else f"${head}$ {unit}"
