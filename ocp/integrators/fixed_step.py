"""Integration with steps of one width; the loop over the steps runs in compiled code."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.integrators.contracts import Passage, Rule, check_step, stopped
from ocp.integrators.control_segments import Segment
from ocp.integrators.stiffness import Linearisation, describe
from ocp.numerics.evaluation import Evaluation
from ocp.numerics.newton import ACCEPTED
from ocp.system import System

BATCHES = (16, 128, 1024, 4096)  # steps in one call
LONG = 1.0  # |fastest eigenvalue| times step, from which on the message of an overflow names that mode


@dataclass(frozen=True)
class FixedStep:
    """A one-step method with steps of one width.

    Between two stops (reported times, jumps of the control) all steps are equal, and as long as `step` allows: report
    at multiples of it if every step shall have the same width.

    Args:
        rule: the one-step method.
        step: longest step [s].

    Raises:
        ValueError: a step that is not a finite number > 0.
    """

    rule: Rule
    step: float

    def __post_init__(self) -> None:
        check_step(self.step)

    def march(self, system: System, parameters: Sequence[float], x0: Array, segments: Sequence[Segment]) -> Passage:
        """Integrate x' = f(x, u(t), p) from x0 through all segments; see `ocp.integrators.contracts.Method`."""
        schedule = _Schedule.of(segments, self.step)
        n = next((size for size in BATCHES if size >= schedule.total), BATCHES[-1])
        run = Evaluation(batch(self.rule, system, n))
        xs = np.full((len(schedule.ends), len(x0)), np.nan)
        x, evaluations = x0, 0
        # Columns lie one after the other: a row of these is a step.
        states, changes, counts = run.outputs[0].reshape(n, len(x0)), run.outputs[1], run.outputs[2]
        run.inputs[3][:] = np.tile(np.array(parameters, dtype=float), n)
        for first in range(0, schedule.total, n):
            run.inputs[0][:] = x
            run.inputs[1][:], run.inputs[2][:] = schedule.steps(first, n, self.rule.nodes, system.u.numel())
            for output in run.outputs:
                output[:] = np.nan  # remains if the evaluation stops early
            run.call()
            steps = min(n, schedule.total - first)
            bad = ~(np.all(np.isfinite(states), axis=1) & (changes <= ACCEPTED))[:steps]
            good = int(np.argmax(bad)) if np.any(bad) else steps
            rows = slice(*np.searchsorted(schedule.ends, [first, first + good]))
            xs[rows] = states[schedule.ends[rows] - first]
            evaluations += int(np.nansum(counts[: min(good + 1, steps)]))
            if good < steps:
                diverged = np.isfinite(changes[good]) and changes[good] > ACCEPTED
                k = first + good
                reason = "the iteration for an implicit step did not converge; take a smaller step"
                if not diverged:
                    # Just before an overflow x is huge; the modes at the start describe the system better.
                    mode = Linearisation(system, parameters).fastest(x0, segments[0].control(segments[0].stops[0]))
                    fast = abs(mode) * schedule.width > LONG
                    reason = f"f is not finite{describe(mode) if fast else ''}"
                return Passage(xs, stopped(schedule.start(k), reason), evaluations)
            x = states[steps - 1].copy()
        return Passage(xs, "", evaluations)


@dataclass(frozen=True, eq=False)
class _Schedule:
    """All steps of a motion; memory is needed for the stops only, not for the steps."""

    segments: Sequence[Segment]
    gaps: Array  # (S,) between stops [s]
    since: Array  # (S,) where they begin [s]
    counts: Array  # (S,) of the steps in them
    ends: Array  # (S,) the step that ends at each stop
    begins: Array  # (segments,) the first step of each segment

    @classmethod
    def of(cls, segments: Sequence[Segment], step: float) -> _Schedule:
        """Divide every interval between stops into equal steps."""
        since = np.concatenate([segment.stops[:-1] for segment in segments] or [np.zeros(0)])
        gaps = np.concatenate([np.diff(segment.stops) for segment in segments] or [np.zeros(0)])
        # A quotient that exceeds a whole number by rounding only does not cost a step more.
        counts = np.maximum(np.ceil(gaps / step * (1.0 - 1e-12) - 1e-9), 1).astype(int)
        ends = np.cumsum(counts) - 1
        stops = np.cumsum([0, *(len(segment.stops) - 1 for segment in segments)])[:-1]
        begins = (ends + 1 - counts)[stops] if len(segments) else np.zeros(0, dtype=int)
        return cls(segments, gaps, since, counts, ends, begins)

    @property
    def total(self) -> int:
        """Number of steps."""
        return int(self.ends[-1]) + 1 if len(self.ends) else 0

    @property
    def width(self) -> float:
        """Width of the first step [s]."""
        return float(self.gaps[0] / self.counts[0])

    def start(self, k: int) -> float:
        """Return where a step begins [s]."""
        return float(self._starts(k, k + 1)[0][0])

    def _starts(self, first: int, last: int) -> tuple[Array, Array]:
        """Return beginnings and widths of steps."""
        steps = np.arange(first, last)
        gap = np.searchsorted(self.ends, steps)
        widths = self.gaps[gap] / self.counts[gap]
        return self.since[gap] + (steps - (self.ends[gap] + 1 - self.counts[gap])) * widths, widths

    def steps(self, first: int, n: int, nodes: Array, nu: int) -> tuple[Array, Array]:
        """Return widths (n,) and controls (n s nu,) of n steps; those beyond the end have no width."""
        last = min(first + n, self.total)
        starts, given = self._starts(first, last)
        widths, u = np.zeros(n), np.zeros((n, len(nodes), nu))
        widths[: last - first] = given
        k = int(np.searchsorted(self.begins, first, side="right")) - 1
        at = first
        while at < last and nu:
            until = min(last, self.begins[k + 1] if k + 1 < len(self.begins) else last)
            part = slice(at - first, until - first)
            times = starts[part, None] + given[part, None] * nodes
            u[part] = self.segments[k].control.sample(times.ravel()).reshape(*times.shape, nu)
            at, k = until, k + 1
        return widths, u.ravel()


@functools.lru_cache(maxsize=32)
def batch(rule: Rule, system: System, n: int) -> ca.Function:
    """Return the function (x, h, u, p) -> (states, changes, evaluations) of n steps, one column for each.

    Args:
        rule: the one-step method.
        system: x' = f(x, u, p).
        n: number of steps.
    """
    step = rule.step(system)
    given = [ca.MX.sym(name, *step.size_in(i)) for i, name in enumerate("xhup")]
    new, _, change, evaluations = step.call(given)
    kept = [ca.densify(part) for part in (new, change, evaluations)]
    return ca.Function("one", given, kept).mapaccum(n)
