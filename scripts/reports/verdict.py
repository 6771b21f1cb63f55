"""The verdict on a solved motion in one sentence, with one cause and one remedy where it is not verified."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ocp import Report, SequenceSolution, Solution, Status
from ocp.problem.constraints import Where
from reports.motion_clearance import Clearances, kept
from reports.motion_solving import AGREEMENT

TRIED = re.compile(r" \(guesses tried: (?:[^()]|\([^()]*\))*\)")
ADVICE = ("raise ", "move ", "loosen ", "widen ", "give ", "use ", "try ")
MANY = 5  # axes from which a light wrist makes the torques poor controls
SMALL = 1e-3  # share of the duration below which a possible gain is not worth a finer grid


@dataclass(frozen=True)
class Verdict:
    """What an engineer wants to know first."""

    ok: bool
    sentence: str
    cause: str = ""  # the most important one, if not ok
    remedy: str = ""

    def __str__(self) -> str:
        return self.sentence if self.ok else f"NOT VERIFIED: {self.cause}. Remedy: {self.remedy}"


def verdict(
    solution: Solution | SequenceSolution, report: Report, difference: float, agreement: float = AGREEMENT,
    clear: Clearances = (),
) -> Verdict:  # fmt: skip
    """Return the verdict on a motion.

    Args:
        solution: of any status.
        report: of `verify`.
        difference: of the recovered torques from those of the solution, share of the limit.
        agreement: difference that is accepted.
        clear: least distances of the links.
    """
    cause, remedy = _fault(solution, report, difference, agreement)
    if not cause and not kept(clear):
        worst = min(clear, key=lambda one: one[0].least - one[2])
        cause = f"{worst[0]} at {worst[1]:.4g} s instead of {worst[2]:g} m"
        remedy = f"--nodes {2 * _elements(solution)}, or a larger margin in [collisions]"
    if not cause:
        return Verdict(True, f"verified: {_accuracy(solution, report)}")
    return Verdict(False, f"not verified: {cause}", cause, remedy)


def diagnosis(message: str) -> tuple[str, str]:
    """Return the one cause and the one remedy that matter most in the message of a failed solve.

    A diagnosis lists what is wrong, each with its remedy behind it where there is one. What is wrong with the task
    comes before what the last iterate breaks.

    Args:
        message: of a solution that is not ok.
    """
    plain = TRIED.sub("", message)
    for status in (Status.INFEASIBLE, Status.FAILED):
        plain = plain.removeprefix(f"{status.value}: ")
    parts = plain.replace(": try ", "; try ").split("; ")
    advised = [k for k, part in enumerate(parts) if k and part.startswith(ADVICE)]
    first = next((k for k in advised if " cannot " in parts[k - 1]), next(iter(advised), None))
    if first is None:
        return parts[0], "change limits, ends or duration, and look at --card"
    too_short = [part for part in parts if part.startswith("the shortest motion found")]
    general = parts[first].startswith("try")
    return (*too_short, parts[0 if general else first - 1])[0], parts[first]


def _fault(
    solution: Solution | SequenceSolution, report: Report, difference: float, agreement: float
) -> tuple[str, str]:
    if not solution.ok:
        return diagnosis(solution.message)
    elements = _elements(solution)
    name = next(iter(report.cures), "")
    finer = f"--nodes {elements + ((report.more_elements(name) if name else 0) or elements)}, or --accuracy 1e-4"
    amount = f" ({report.amounts[name]})" if report.amounts.get(name) else ""
    if name == "drift":
        finer += _other_form(solution)
        drift = f"{report.drift:.1e} of the range{amount}"
        return f"integrated with its own torques the motion drifts away by {drift}", finer
    if name == "violation":
        what = f" ({report.violation.what})" if report.violation.what else ""
        return f"a limit is exceeded by {100 * report.violation:.2g} % of its range between nodes{what}", finer
    finer += _other_form(solution)
    if name == "energy":
        return f"the energy balance is open by {report.energy:.1e}", finer
    if name:
        gain = report.switching if np.isfinite(report.switching) else report.hamiltonian_offset
        return f"the motion could still gain about {100 * gain:.2g} % of its cost{amount}", f"--polish, or {finer}"
    if not difference <= agreement:
        return (
            f"the recovered torques differ from the controls by {difference:.1e} of the limit",
            f"--nodes {2 * elements}, or --allow torques={2.0 * difference:.0e}",
        )
    words = " ".join(report.failures)
    return words, f"--nodes {2 * elements}" if words else ""


def _other_form(solution: Solution | SequenceSolution) -> str:
    """Return the advice to take accelerations as controls, for arms with many axes and limits of their speeds."""
    problem = solution.phases[0].problem if isinstance(solution, SequenceSolution) else solution.problem
    if problem is None or "v" not in problem.system.signals or problem.system["v"].numel() < MANY:
        return ""
    system, n = problem.system, problem.system["v"].numel()
    limited = {label.name for one in problem.subject_to if one.where is Where.ALONG for label in problem.labels(one)}
    speeds = {label.name for label in system.label("v", n)}
    held = system.label("u", n)[0].name.startswith("d2")  # accelerations are the controls already
    return ", or --form inverse" if limited & speeds and not held else ""


def _elements(solution: Solution | SequenceSolution) -> int:
    legs = solution.phases if isinstance(solution, SequenceSolution) else (solution,)
    return max(len(leg.grid) for leg in legs)


def _accuracy(solution: Solution | SequenceSolution, report: Report) -> str:
    limits = f"limits are kept to {_percent(max(float(report.violation), 0.0))} of their range"
    if isinstance(solution, Solution) and solution.structure is not None:
        return f"{limits}, and the switching times are exact"
    if not np.isfinite(report.switching):
        return limits
    gain = max(float(report.switching), 0.0)
    advice = "" if gain < SMALL else "; --polish or --accuracy finds it"
    return f"{limits}, and {_percent(gain, 'about ')} of the cost is left to gain nearby{advice}"


def _percent(share: float, about: str = "") -> str:
    return f"{about}{100 * share:.2g} %" if share >= 1e-6 else "less than 0.0001 %"
