"""Tables of the stability suite in Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

from hard_cases.case import Case, Figure, Finding

HEAD = ("group", "case", "at risk", "towards", "from", "to", "worst", "tolerance", "condition", "figures", "")


def by_group(findings: Sequence[Finding]) -> str:
    """Return one line for each group: cases, figures, failures, the largest share of a tolerance."""
    lines = ["| group | cases | figures | failed | outside the domain | worst figure / tolerance | seconds |",
             "|---|---:|---:|---:|---:|---:|---:|"]  # fmt: skip
    for group in dict.fromkeys(finding.case.group for finding in findings):
        own = [finding for finding in findings if finding.case.group == group]
        inside = [finding for finding in own if not finding.case.outside]
        failed = sum(not finding.passed for finding in inside)
        worst = max((finding.worst.share for finding in inside if finding.figures), default=math.nan)
        count, seconds = sum(len(finding.figures) for finding in own), sum(finding.seconds for finding in own)
        lines.append(
            f"| {group} | {len(own)} | {count} | {failed} | {len(own) - len(inside)} | {worst:.2g} | {seconds:.1f} |"
        )
    return "\n".join(lines)


def as_markdown(findings: Sequence[Finding]) -> str:
    """Return one line for each case with its worst figure."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|---|---|---|" + "---:|" * 6 + "---|"]
    for finding in findings:
        case, figures = finding.case, finding.figures
        if not figures:
            lines.append(f"| {case.group} | {case.name} | {case.quantity} | {case.towards} |" + " |" * 6 + " none |")
            continue
        worst = finding.worst
        distances = [figure.distance for figure in figures if not math.isnan(figure.distance)]
        conditions = [figure.condition for figure in figures if not math.isnan(figure.condition)]
        note = worst.note if not finding.passed else "" if case.towards else figures[-1].note
        verdict = "outside: " + case.outside if case.outside else "passed" if finding.passed else "**failed**"
        cells = [
            case.group, case.name, case.quantity, case.towards,
            *((f"{distances[0]:.1e}", f"{distances[-1]:.1e}") if distances else ("", "")),
            f"{worst.value:.1e}", f"{worst.tolerance:.1e}", f"{max(conditions):.1e}" if conditions else "",
            str(len(figures)), "; ".join(filter(None, (verdict, note))),
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |")
    return "\n".join(lines)


def as_csv(findings: Sequence[Finding]) -> str:
    """Return every figure with every digit."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["group", "case", "quantity", "towards", "distance", "value", "tolerance", "condition", "passed",
                     "outside", "note"])  # fmt: skip
    for finding in findings:
        case = finding.case
        for f in finding.figures:
            numbers = [repr(float(number)) for number in (f.distance, f.value, f.tolerance, f.condition)]
            writer.writerow([case.group, case.name, case.quantity, case.towards, *numbers, f.passed, case.outside,
                             f.note])  # fmt: skip
    return text.getvalue()


def from_csv(text: str) -> list[Finding]:
    """Return the findings of a table that `as_csv` wrote, without the seconds."""
    figures: dict[Case, list[Figure]] = {}
    cases: dict[tuple[str, str], Case] = {}
    for row in csv.DictReader(io.StringIO(text)):
        key = row["group"], row["case"]
        if key not in cases:
            cases[key] = Case(*key, row["quantity"], row["towards"], list, outside=row["outside"])
        value, tolerance, distance, condition = (
            float(row[name]) for name in ("value", "tolerance", "distance", "condition")
        )
        figures.setdefault(cases[key], []).append(Figure(value, tolerance, distance, condition, row["note"]))
    return [Finding(case, tuple(own), math.nan) for case, own in figures.items()]
