"""Sparse derivatives of an NLP, assembled from the small derivatives of functions that are repeated over the grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ocp.numerics.compilation import Compilation, Compile
from ocp.transcription.compiled_blocks import Points
from ocp.transcription.local_functions import Entries, Local
from ocp.transcription.scaled_nlp import derivative_functions


def assemble(
    blocks: Sequence[tuple[Local, Sequence[ca.MX]]], z: ca.MX, s: ca.MX, translate: Compile | None = None
) -> tuple[dict[str, ca.MX], dict[str, ca.Function], Compilation | None]:
    """Return an NLP made of local functions: cost, rows, and the functions of their derivatives.

    Args:
        blocks: local functions in the order of their rows, each with its inputs (one column for each copy).
        z: (nz,) unknowns.
        s: parameters of the NLP.
        translate: compiles the functions that have more than one copy; its result is returned as well.
    """
    linear = [local for local, _ in blocks if local.linear_cost]
    blocks = [(local, inputs) for local, inputs in blocks if local.rows or not local.values.is_zero()]
    starts = np.cumsum([0, *(local.rows * local.copies for local, _ in blocks)]).tolist()
    size, count = z.numel(), starts[-1]
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", count)
    g, g_again = list[ca.MX](), list[ca.MX]()
    gradient, jacobian, hessian = [local.linear_gradient() for local in linear], list[Entries](), list[Entries]()
    f = f_again = sum((ca.dot(slope, z[index.tolist()]) for index, _, slope in gradient), ca.MX(0))
    derived = [local.derived() for local, _ in blocks]
    functions = [
        here.functions(local.inputs, k) for k, ((local, _), here) in enumerate(zip(blocks, derived, strict=True))
    ]
    compilation, points = None, dict[int, Points]()
    if translate is not None:
        given = [local.points(here, k) for k, ((local, _), here) in enumerate(zip(blocks, derived, strict=True))]
        points = {k: one for k, one in enumerate(given) if one is not None}
        sources = [points[k].functions if k in points else parts for k, parts in enumerate(functions)]
        repeated = [(k, part) for k, (local, _) in enumerate(blocks) if local.copies > 1 for part in sources[k]]
        compilation = translate([sources[k][part] for k, part in repeated])
        for (k, part), function in zip(repeated, compilation.functions, strict=True):
            sources[k][part] = function
    for k, (local, inputs) in enumerate(blocks):
        here, mapped = derived[k], dict[str, Any]()
        if k in points:
            mapped |= points[k].mapped(list(functions[k]))
        else:
            mapped |= {part: function.map(local.copies) for part, function in functions[k].items()}
        at = [ca.reshape(z[local.unknowns.T.ravel().tolist()], *local.unknowns.shape), *inputs]
        if "rows" in mapped:
            value, nonzeros = mapped["slopes"](*at)
            g.append(ca.vec(mapped["rows"](*at)))
            g_again.append(ca.vec(value))
            row, column = local.triplets(here.slopes[:-1, :].sparsity())
            jacobian.append((starts[k] + row, column, ca.vec(nonzeros)))
        if "cost" in mapped:
            value, nonzeros = mapped["gradient"](*at)
            f += _total(mapped["cost"](*at))
            f_again += _total(value)
            row, column = local.triplets(here.slopes[-1, :].sparsity())
            gradient.append((column, np.zeros_like(row), ca.vec(nonzeros)))
        if "curvature" in mapped:
            own = ca.reshape(lam_g[starts[k] : starts[k + 1]], local.rows, local.copies)
            lam = ca.vertcat(own, ca.repmat(lam_f, 1, local.copies))
            nonzeros = mapped["curvature"](*at, lam)
            one, other = (local.unknowns[list(part)].T.ravel() for part in here.upper.sparsity().get_triplet())
            hessian.append((np.minimum(one, other), np.maximum(one, other), ca.vec(nonzeros)))
    g_slopes = _column(g_again), sparse_matrix(jacobian, (count, size))
    f_slopes = f_again, ca.densify(sparse_matrix(gradient, (size, 1)))
    curvature = sparse_matrix(hessian, (size, size))
    derivatives = derivative_functions((z, s, lam_f, lam_g), f_slopes, g_slopes, curvature)
    return {"x": z, "p": s, "f": f, "g": _column(g)}, derivatives, compilation


def _column(parts: Sequence[ca.MX]) -> ca.MX:
    return parts[0] if len(parts) == 1 else ca.vertcat(ca.MX(0, 1), *parts)


def _total(row: ca.MX) -> ca.MX:
    return ca.sum2(row) if row.numel() > 1 else row


def sparse_matrix(parts: Sequence[Entries], shape: tuple[int, int]) -> ca.MX:
    """Return the sparse matrix with the given entries; entries with the same indices are added.

    Args:
        parts: rows, columns and values, in any order.
        shape: of the matrix.
    """
    empty = np.zeros(0, dtype=np.int64)
    rows, columns = (np.concatenate([empty, *(part[i] for part in parts)]) for i in (0, 1))
    values = _column([part[2] for part in parts])
    keys = columns * shape[0] + rows
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.diff(keys, prepend=-1) != 0
    filled = keys[first]
    starts = np.searchsorted(filled, shape[0] * np.arange(shape[1] + 1))
    pattern = ca.Sparsity(*shape, starts.tolist(), (filled % shape[0]).tolist())
    nonzeros = values[order[first].tolist()]
    if not first.all():
        more, at = order[~first], np.cumsum(first)[~first] - 1
        add = ca.Sparsity.triplet(len(filled), len(more), at.tolist(), list(range(len(more))))
        nonzeros += ca.DM(add, 1.0) @ values[more.tolist()]
    return ca.MX(pattern, nonzeros)
