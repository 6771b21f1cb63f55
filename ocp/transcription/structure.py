"""NLPs of problems of the same structure: the graphs are made once in a process, whatever the bounds and ends are."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import casadi as ca

from ocp.numerics.compilation import Compile
from ocp.numerics.thread_cache import ThreadCache
from ocp.problem.equations_along import path_equalities
from ocp.problem.problem import Fixed, Problem
from ocp.transcription.direct_collocation import transcribe
from ocp.transcription.grid import Grid
from ocp.transcription.nlp import Nlp
from ocp.transcription.scaling import Scaling
from ocp.transcription.schemes.scheme import Scheme

KEPT = ThreadCache(8)  # NLPs by the structure of their problem
LARGEST = 20_000  # states at collocation points of an NLP that is kept


def transcribed(problem: Problem, scheme: Scheme, grid: Grid, scaling: Scaling, translate: Compile | None) -> Nlp:
    """Return the NLP of a problem on a grid, made anew only if none of the same structure is kept.

    Args:
        problem, scheme, grid, scaling, translate: as for `transcribe`; NLPs with compiled functions are not kept.
    """
    size = len(grid) * scheme.degree * problem.system.x.numel()
    structure = b"" if translate is not None or size > LARGEST else structure_of(problem, scheme, len(grid), scaling)
    if not structure:
        return transcribe(problem, scheme, grid, scaling, translate=translate)
    nlp = KEPT.get(structure, lambda: transcribe(problem, scheme, grid, scaling))
    return replace(nlp, problem=problem, scheme=scheme, grid=grid, scaling=scaling, structure=structure)


def structure_of(problem: Problem, scheme: Scheme, elements: int, scaling: Scaling) -> bytes:
    """Return a digest of everything that the graphs of an NLP depend on; empty for problems that are not cached.

    Two problems with the same digest have the same NLP and differ in bounds, ends, durations and parameter values only.

    Args:
        problem: one phase; equations along the motion put numbers into the graphs and are not cached.
        scheme: of every element.
        elements: number of elements.
        scaling: of the unknowns and rows.
    """
    if path_equalities(problem):
        return b""
    system, cost, implicit = problem.system, problem.minimise, problem.system.implicit
    outputs = [system.rate, cost.running, cost.final, cost.initial, *(c.expression for c in problem.subject_to)]
    graphs = [ca.Function("problem", [system.x, system.u, system.p], outputs)]
    if implicit is not None:
        names = list(implicit.signals)
        inner = [implicit.rate, implicit.residual, implicit.value, *(implicit.signals[name] for name in names)]
        inner += [system.signals[name] for name in names]
        graphs += [ca.Function("inner", [system.x, system.u, system.p, implicit.y], inner), implicit.solve]
    digest = hashlib.blake2b(digest_size=24)
    for graph in graphs:
        digest.update(str(graph.serialize()).encode())
    arrays = [scheme.points, scheme.weights, scheme.nodes, scheme.state, scheme.rate]
    arrays += [scaling.x, scaling.u, scaling.free, *scaling.limits]
    numbers = elements, cost.time, isinstance(problem.horizon, Fixed), scaling.horizon, scaling.cost, scheme.at
    words = scheme.name, scheme.degree, scheme.control.value, scheme.basis, scheme.slope_at_start
    digest.update(repr((numbers, words, [c.where.value for c in problem.subject_to])).encode())
    for array in arrays:
        digest.update(repr(array.shape).encode() + array.tobytes())
    return digest.digest()
