"""Orientations of the tool: matrices of what the user gives, and the turn from one to another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.rigid_bodies.joint import rotation_of
from ocp.checks import Array

Rotation = Sequence[float] | Sequence[Sequence[float]] | Array


def rotation_matrix(rotation: object) -> Array:
    """Return the matrix (3, 3) of roll, pitch, yaw [rad] or of a matrix."""
    return rotation_of("rotation", rotation)


def axis_angle(rotation: Array) -> Array:
    """Return angle times axis (K, 3) of rotations (K, 3, 3)."""
    sine = np.stack([rotation[:, i, j] - rotation[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1) / 2.0
    size = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(size, (np.trace(rotation, axis1=1, axis2=2) - 1.0) / 2.0)
    factor = np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 1.0)
    result = sine * factor[:, None]
    half = (size <= 1e-9) & (angle > 1.0)
    if np.any(half):  # half a turn: the axis is a column of R + 1
        axis = rotation[half] + np.eye(3)
        best = np.argmax(np.linalg.norm(axis, axis=1), axis=1)
        column = axis[np.arange(len(axis)), :, best]
        result[half] = np.pi * column / np.linalg.norm(column, axis=1, keepdims=True)
    return np.asarray(result)
