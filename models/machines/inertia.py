"""Masses and inertia tensors that a rigid body can have."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

# Relative tolerance of the triangle inequality, for the rounding of measured data.
ROUNDING = 1e-9


def check_mass(name: str, value: float) -> None:
    """Refuse a mass that is not positive.

    Args:
        name: of the parameter.
        value: mass [kg].

    Raises:
        ValueError: value <= 0.
    """
    if value <= 0.0:
        raise ValueError(f"{name}: got {value:g} kg, expected a mass > 0 (physical=False admits massless bodies)")


def check_moment(name: str, value: float) -> None:
    """Refuse a single moment of inertia that is not positive.

    Args:
        name: of the parameter.
        value: moment of inertia [kg m^2].

    Raises:
        ValueError: value <= 0.
    """
    if value <= 0.0:
        raise ValueError(
            f"{name}: got {value:g} kg m^2, expected a moment of inertia > 0 (physical=False admits bodies without one)"
        )


def check_tensor(body: int, nominal: Mapping[str, float]) -> None:
    """Refuse an inertia tensor that no rigid body has.

    The tensor must be positive definite and its principal moments J_1 <= J_2 <= J_3 satisfy J_3 <= J_1 + J_2.

    Args:
        body: number k of the body; the entries are Theta_k_11 .. Theta_k_33 [kg m^2], missing products are zero.
        nominal: parameter values.

    Raises:
        ValueError: the tensor is impossible; the message names its parameters.
    """
    prefix = f"Theta_{body}_"
    tensor = np.array([[nominal.get(prefix + "".join(sorted(f"{i}{j}")), 0.0) for j in "123"] for i in "123"])
    names = ", ".join(name for name in nominal if name.startswith(prefix))
    moments = np.linalg.eigvalsh(tensor)
    listed = ", ".join(f"{moment:g}" for moment in moments)
    if moments[0] <= 0.0:
        raise ValueError(
            f"{names}: inertia tensor with principal moments {listed} kg m^2 is not positive definite; give moments > 0"
        )
    if moments[2] > (moments[0] + moments[1]) * (1.0 + ROUNDING):
        raise ValueError(
            f"{names}: principal moments {listed} kg m^2 break the triangle inequality "
            "(the largest exceeds the sum of the others); no rigid body has them"
        )
