"""Parameter study of a scene file: solve every case, go on where it stopped, draw what depends on what."""

from __future__ import annotations

from reports.command import command_parser, exit_with  # first: it decides how pictures are drawn

# isort: split

import argparse
import functools
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from reports import study_file
from reports.output import add_output, output_folder, working
from reports.progress import progress_of

from models import Scene
from models.plots import studies
from models.scenes.task import Task
from models.scenes.toml_document import SceneError
from ocp import StoreError, Study, StudyTable
from ocp.studies.batches import Batches
from ocp.studies.executors import KINDS, executor
from ocp.studies.main_effects import influences
from ocp.studies.neighbour_check import unchecked_jumps

EXAMPLES = """examples:
  python scripts/study.py scripts/scenes/study.toml --dry-run    what would be computed
  python scripts/study.py study.toml --jobs 2 --report           solve, rank, draw, an HTML report with every motion
  python scripts/study.py study.toml --resume                    go on after an interruption; what is stored stays
  python scripts/study.py study.toml --retry-failed --export table.csv
  python scripts/study.py study.toml --executor dask:tcp://HOST:8786

STUDY is a scene file with a table [study]; see docs/studies.md. What is stored is not computed again.
Exit status: 0 all solved, 1 some failed, 2 wrong usage, 130 interrupted."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if every case is solved, 1 if some are not, 2 for wrong usage, 130 after Ctrl-C."""
    options = command_line().parse_args(arguments)
    store = options.store or options.study.with_suffix(".db")
    try:
        study, document = study_file.load(options.study, store)
        study = study if options.starts is None else replace(study, starts=options.starts)
        if options.resume:
            _check_resume(study, store)
        if options.dry_run:
            print(plan(study, store))
            return 0
        options.output = output_folder(options, options.study.stem)
        _check_exports(options.export)
        table = _run(study, options)
    except BrokenPipeError:
        raise
    except (SceneError, StoreError, ImportError, ValueError, RuntimeError, OSError) as error:
        print(f"study: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"study: interrupted; what is finished stands in {store}, the same command goes on", file=sys.stderr)
        return 130
    try:
        files = _write(study, table, options, document.file)
    except (OSError, ImportError, ValueError) as error:
        print(f"study: {error}", file=sys.stderr)
        return 2 if isinstance(error, ValueError) else 1
    if options.json:
        print(json.dumps(account(table, files), indent=2))
    elif not options.quiet:
        print(report(table, options.result))
        print(f"files  {', '.join(map(os.fspath, [store, *files]))}")
    return 0 if all(table.ok) else 1


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command_parser(__doc__ or "", EXAMPLES)
    parser.add_argument("study", type=Path, metavar="STUDY", help="scene file (TOML) with a table [study]")
    parser.add_argument("--store", type=Path, metavar="FILE", help="SQLite file of the results (default: STUDY.db)")
    parser.add_argument(
        "--resume", action="store_true", help="go on with a store that holds this very study, or refuse"
    )
    parser.add_argument("--jobs", type=_jobs, default=1, metavar="N", help="processes at once (default: 1)")
    parser.add_argument("--executor", metavar="KIND", help=f"{', '.join(KINDS)} (default: here, or processes)")
    parser.add_argument("--batch", type=_jobs, metavar="N", help="cases sent to a cluster at once, for cheap cases")
    parser.add_argument(
        "--starts", type=_jobs, metavar="N",
        help="starts of the search for local optima of every case solved cold (default: of the file, 1)",
    )  # fmt: skip
    parser.add_argument("--dry-run", action="store_true", help="say what would be computed, and stop")
    parser.add_argument("--retry-failed", action="store_true", help="try failed cases again, with all first guesses")
    parser.add_argument("--export", type=Path, action="append", default=[], metavar="FILE", help=".csv or .parquet")
    parser.add_argument("--result", default="duration", metavar="NAME", help="column to draw first (default: duration)")
    add_output(parser, "pictures, CSV and report")
    parser.add_argument("--report", action="store_true", help="write an HTML report with the motion of every case, too")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--json", action="store_true", help="print the account as JSON")
    return parser


def plan(study: Study, store: Path) -> str:
    """Return what a run would do, in words."""
    known = study.table().records if store.exists() else (None,) * len(study.cases)
    done = sum(result is not None and result.ok for result in known)
    failed = sum(result is not None and not result.ok for result in known)
    axes = {name: list(dict.fromkeys(case[name] for case in study.cases)) for name in study.cases[0]}
    lines = [f"{len(study.cases)} cases: {done} stored, {failed} failed, {len(known) - done - failed} to compute"]
    for name, values in axes.items():
        ends = f"{values[0]} .. {values[-1]}" if len(values) > 1 else f"{values[0]}"
        lines.append(f"  {name}: {len(values)} values, {ends}")
    lines.append("polished, structures carried over" if study.polished else "not polished")
    return "\n".join(lines)


def report(table: StudyTable, result: str) -> str:
    """Return the summary of a study: counts, failures, what matters, suspicious neighbours."""
    lines = [str(table)]
    try:
        rows = influences(table, result)
    except (ValueError, KeyError) as error:
        rows = ()
        lines.append(f"no ranking: {error.args[0]}")
    if rows:
        lines.append(f"what {result} depends on:")
        lines += [
            f"  {row.axis:24s} elasticity {row.elasticity:+8.3f}   main effect {row.effect:+10.4g}   "
            f"share {100 * row.share:5.1f} %"
            for row in rows
        ]
    better = [k for k, way in enumerate(table["way"]) if ", better than" in way]
    if better:
        lines.append(f"better optima found from a neighbour or a cold start, and kept: cases {_few(better)}")
    odd = unchecked_jumps(table.cases, table.records)
    lines += [f"jump: cases {a} and {b} may lie in different local optima, not compared" for a, b in odd[:10]]
    if table.failures:
        lines.append("--retry-failed tries failed cases from solved neighbours, step by step, and with more guesses")
    return "\n".join(lines)


def _few(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:10])) + (f" and {len(numbers) - 10} more" if len(numbers) > 10 else "")


def account(table: StudyTable, files: Sequence[Path]) -> dict[str, Any]:
    """Return everything that the command prints as plain data."""
    return {
        "cases": len(table),
        "solved": int(table.ok.sum()),
        "failures": {str(k): text for k, text in table.failures.items()},
        "ways": {way: int(sum(table["way"] == way)) for way in sorted(set(table["way"]) - {""})},
        "jumps": [list(pair) for pair in unchecked_jumps(table.cases, table.records)],
        "files": [os.fspath(path) for path in files],
    }


def _check_resume(study: Study, store: Path) -> None:
    stored = sum(result is not None for result in study.table().records) if store.exists() else 0
    if not stored:
        raise ValueError(f"--resume: {store} holds no case of this study; its settings differ, or it has not begun")


def _check_exports(files: Sequence[Path]) -> None:
    for path in files:
        if path.suffix not in (".csv", ".parquet"):
            raise ValueError(f"--export: got {path}, expected a file .csv or .parquet")
        if not path.parent.is_dir():
            raise ValueError(f"--export: there is no folder {path.parent}")
        if path.suffix == ".parquet" and find_spec("pyarrow") is None:
            raise ImportError("--export: .parquet needs PyArrow: pip install pyarrow; .csv needs nothing")


def _run(study: Study, options: argparse.Namespace) -> StudyTable:
    kind = options.executor or ("processes" if options.jobs > 1 else "here")
    shown = not (options.quiet or options.json)
    with executor(kind, options.jobs) as run, progress_of(len(study.cases), shown) as watch:
        if options.batch is not None:
            if not isinstance(run, Executor):
                raise ValueError("--batch: needs --executor dask, dask:ADDRESS or mpi")
            run = Batches(run, options.batch)
        return study.run(run, options.retry_failed, watch)


def _write(study: Study, table: StudyTable, options: argparse.Namespace, name: str) -> list[Path]:
    if options.result not in table.results and any(table.ok):
        raise ValueError(f"--result: no column {options.result!r}; there are {', '.join(table.results)}")
    stem, units = Path(name).stem, study_file.units(study)
    files = [options.output / f"{stem}.csv", *options.export]
    for path in files:
        if path.suffix == ".parquet":
            table.write_parquet(path)
        else:
            table.write_csv(path, units)
    if any(table.ok):
        files += studies.draw(table, options.result, options.output / stem, units, options.formats)
    if options.report:
        from html_reports.study_page import write_study_report

        files.append(options.output / f"{stem}.html")
        with working("writing the report", not options.quiet):
            text = Path(name).read_text(encoding="utf-8")
            scenes = functools.partial(_scene_of, study)
            write_study_report(files[-1], stem, table, options.result, units, scenes, text)
    return files


def _scene_of(study: Study, number: int) -> tuple[Scene, Task]:
    """Return scene and task of a case, by its number."""
    problem = study.function
    assert isinstance(problem, study_file.SceneProblem)
    return problem.at({name: study.cases[number][name] for name in problem.others})


def _jobs(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"got {value}, expected a whole number >= 1")
    return value


if __name__ == "__main__":
    exit_with(main)
