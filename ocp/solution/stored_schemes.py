"""Collocation schemes as part of a solution file: by name, or with all their data if they are the user's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from ocp import checks
from ocp.transcription.schemes.families import FAMILIES
from ocp.transcription.schemes.scheme import Control, Scheme

MOST_NODES = 100  # of a scheme that a file defines


def scheme_data(scheme: Scheme) -> dict[str, Any]:
    """Return a scheme as JSON data: name, degree and control, and all its fields if it is of no family.

    Args:
        scheme: of this package or of the user.
    """
    whole = {
        one.name: np.asarray(getattr(scheme, one.name)).tolist() for one in fields(scheme) if one.name != "control"
    }
    short = {"name": scheme.name, "degree": scheme.degree, "control": scheme.control.value}
    if scheme.name in FAMILIES:
        own = FAMILIES[scheme.name](scheme.degree, scheme.control)
        if all(np.array_equal(getattr(own, name), value) for name, value in whole.items()):
            return short
    return whole | short


def scheme_from(about: Mapping[str, Any]) -> Scheme:
    """Return the scheme of which `scheme_data` returned the data.

    Args:
        about: as read from a file.

    Raises:
        KeyError, TypeError, ValueError: missing or wrong data.
    """
    name, degree, control = str(about["name"]), int(about["degree"]), Control(about["control"])
    if "points" not in about:
        if name not in FAMILIES:
            raise ValueError(f"scheme {name!r} is unknown; known are {', '.join(FAMILIES)}")
        return FAMILIES[name](degree, control)
    points, weights, nodes = (checks.column(part, about[part]) for part in ("points", "weights", "nodes"))
    state, rate = (np.array(about[part], dtype=float) for part in ("state", "rate"))
    at, basis = (tuple(map(int, about[part])) for part in ("at", "basis"))
    fits = (
        len(points) == len(weights) == len(at) == degree and len(nodes) <= MOST_NODES
        and state.ndim == rate.ndim == 2 and state.shape == (len(rate), len(nodes)) and rate.shape[1] == degree
        and np.all(np.isfinite(state)) and np.all(np.isfinite(rate))
        and all(0 <= index < len(nodes) for index in (*at, *basis))
    )  # fmt: skip
    if not fits:
        raise ValueError(f"the data of scheme {name!r} do not fit together")
    order = int(about["order"])
    return Scheme(
        name, degree, control, points, weights, nodes, at, state, rate, basis, bool(about["slope_at_start"]), order
    )
