"""Numbers that carry their unit and what they refer to."""

from __future__ import annotations

import numpy as np


class Figure(float):
    """A number with its unit, the scale that it is relative to, and the component and time at which it occurs."""

    unit: str
    scale: str
    what: str
    at: float

    def __new__(cls, value: float, unit: str, scale: str, what: str = "", at: float = float("nan")) -> Figure:
        """Return the number with its description."""
        figure = super().__new__(cls, value)
        figure.unit, figure.scale, figure.what, figure.at = unit, scale, what, at
        return figure

    def __str__(self) -> str:
        where = f" ({self.what}{f' at {self.at:.4g} s' if np.isfinite(self.at) else ''})" if self.what else ""
        return f"{float(self):.2e} {self.unit} of {self.scale}{where}"
