"""Stability suite: measure every hard case, and write the table and the picture of error against distance."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from hard_cases import picture
from hard_cases.case import Finding, run
from hard_cases.suite import CASES
from hard_cases.table import as_csv, as_markdown, by_group, from_csv

from ocp import sweep
from ocp.numerics.files import written_whole

TITLE = """# Stability suite: measured figures

Written by `python scripts/stability.py`; the domain is in [stability.md](stability.md)."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if every case inside the declared domain passes, 1 if not."""
    options = command_line().parse_args(arguments)
    if options.redraw is not None:
        try:
            picture.draw(from_csv(options.redraw.read_text(encoding="utf-8")), options.redraw.with_suffix(".png"))
        except (OSError, ValueError, KeyError) as error:
            print(f"stability: {options.redraw}: {error}", file=sys.stderr)
            return 2
        return 0
    chosen = [
        number
        for number, case in enumerate(CASES)
        if (case.fast or not options.fast) and (not options.group or case.group in options.group)
    ]
    if not chosen:
        print(
            f"stability: no such group; there are {', '.join(dict.fromkeys(c.group for c in CASES))}", file=sys.stderr
        )
        return 2
    begun = time.perf_counter()
    findings = measured(chosen, options.jobs, options.quiet)
    seconds = time.perf_counter() - begun
    head = f"{len(findings)} cases, {sum(len(f.figures) for f in findings)} figures, {seconds:.0f} s"
    try:
        files = [] if options.output is None else written(findings, head, options.output)
    except OSError as error:
        print(f"stability: {error}", file=sys.stderr)
        return 1
    print(by_group(findings))
    bad = [finding for finding in findings if not finding.passed and not finding.case.outside]
    for finding in bad:
        wrong = [str(figure) for figure in finding.figures if not figure.passed][:5]
        print("\n".join(f"FAILED {finding.case}: {text}" for text in wrong or ["no figure was measured"]))
    print(f"{head}: {len(bad)} failed" + (f"; files {', '.join(map(os.fspath, files))}" if files else ""))
    return 1 if bad else 0


def written(findings: list[Finding], head: str, folder: Path) -> list[Path]:
    """Write table, CSV and picture of the findings in place of older ones, and return their paths.

    Args:
        findings: of the suite.
        head: first line of the table.
        folder: made if it is not there.

    Raises:
        OSError: a file cannot be written; it stays as it was.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"stability_table.{kind}" for kind in ("md", "csv", "png")]
    page = "\n\n".join((TITLE, f"{head}.", by_group(findings), as_markdown(findings)))
    for path, text in zip(files, (f"{page}\n", as_csv(findings)), strict=False):
        with written_whole(path) as part:
            part.write_text(text, encoding="utf-8")
    picture.draw(findings, files[2])
    return files


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None,
        epilog="Example: python scripts/stability.py --fast --jobs 2 runs the cases of the ordinary tests.",
    )
    parser.add_argument("--fast", action="store_true", help="only the cases of the ordinary tests")
    parser.add_argument("--group", nargs="+", metavar="NAME", help="only these groups")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes at once")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="write stability_table.md, .csv and .png there, in place of older ones",
    )
    parser.add_argument("--redraw", type=Path, metavar="CSV", help="draw the picture of a table again, and stop")
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    return parser


def measured(numbers: Sequence[int], jobs: int, quiet: bool) -> list[Finding]:
    """Return the findings of cases, in order.

    Args:
        numbers: of the cases.
        jobs: processes at once.
        quiet: whether to show no progress.
    """
    results = []
    with ProcessPoolExecutor(max(jobs, 1), multiprocessing.get_context("spawn")) as pool:
        for done, result in enumerate(sweep(plainly, [{"number": n} for n in numbers], pool), 1):
            case = CASES[result.case["number"]]
            figures, seconds = result.value if result.value is not None else ((), result.seconds)
            results.append(Finding(case, tuple(figures), seconds))
            if not quiet:
                verdict = "passed" if results[-1].passed else "outside" if case.outside else f"FAILED {result.error}"
                print(f"{done:4d}/{len(numbers)}  {seconds:6.1f} s  {verdict:8s}  {case}", file=sys.stderr, flush=True)
    return results


def plainly(number: int) -> tuple[tuple[object, ...], float]:
    """Measure a case in another process; what comes back can travel."""
    finding = run(CASES[number])
    return finding.figures, finding.seconds


if __name__ == "__main__":
    sys.exit(main())
