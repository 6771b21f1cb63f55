"""Picture files: written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from ocp.numerics.files import written_whole


def finish(figure: Figure, path: Path, dpi: int = 150) -> None:
    """Write a picture and close it; an existing file is replaced only when the new one is complete.

    Args:
        figure: of matplotlib.
        path: of the picture; the suffix chooses the format.
        dpi: dots per inch.
    """
    try:
        with written_whole(path) as part:
            figure.savefig(part, dpi=dpi)
    finally:
        plt.close(figure)
