"""Polish random tasks: how many are solved, verified and polished, in how many seconds. Results go to a CSV file.

    python scripts/benchmark_polish.py results.csv --tasks 10

A run that was interrupted continues: tasks that stand in the file are not solved again.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import resource
import time
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.random_tasks import RandomTask, random_tasks

from models.scenes.scene_template import TASKS
from ocp import Ipopt, Solution, polish, solve, uniform, verify

COLUMNS = (
    "task", "speed", "friction", "status", "t_f", "verified", "solve_s", "polished", "t_polished", "polish_verified",
    "polish_s", "cpu_s", "reason",
)  # fmt: skip


def main() -> None:
    """Run the tasks that the file lacks, then print the summary of the file."""
    options = _options()
    path = Path(options.results)
    done = {row["task"] for row in _rows(path)}
    for machine in options.machines:
        for task in random_tasks(machine, options.tasks):
            if task.number % options.every or task.name in done:
                continue
            row = _limited(task, options.seconds, options.wall)
            with path.open("a", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                if file.tell() == 0:
                    writer.writeheader()
                writer.writerow(row)
            print(" ".join(f"{row.get(name, '')}"[:90] for name in COLUMNS), flush=True)
    print(summary(_rows(path)))


def run(task: RandomTask, wall: float) -> dict[str, Any]:
    """Solve, verify, polish and verify one task."""
    problem = task.problem()
    begun = time.process_time()
    coarse: Solution = solve(problem, grid=uniform(50), solver=Ipopt(progress=False))
    solved = time.process_time()
    row: dict[str, Any] = {
        "task": task.name, "speed": int(task.speed is not None), "friction": int(task.friction),
        "status": coarse.status.name, "t_f": coarse.duration, "solve_s": round(solved - begun, 3),
    }  # fmt: skip
    if not coarse.ok:
        return row | {"reason": coarse.message}
    row["verified"] = int(verify(coarse).ok)
    begun, clock = time.process_time(), time.perf_counter()
    result = polish(coarse, seconds=wall)
    row |= {"polish_s": round(time.perf_counter() - clock, 3), "cpu_s": round(time.process_time() - begun, 3)}
    row |= {"t_polished": result.duration, "polished": int(result.structure is not None), "reason": result.message}
    return row | {"polish_verified": int(verify(result).ok)}


def _limited(task: RandomTask, seconds: float, wall: float) -> dict[str, Any]:
    """Run one task in a process of its own that is ended after so many seconds."""
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    process = context.Process(target=_counted, args=(task, seconds, wall, queue))
    process.start()
    while process.is_alive() and queue.empty():
        time.sleep(0.05)
    if queue.empty():
        process.join()
        base = {"task": task.name, "speed": int(task.speed is not None), "friction": int(task.friction)}
        return base | {"status": "STOPPED", "reason": f"no result within {seconds:g} s of processor time"}
    row: dict[str, Any] = queue.get()
    process.join()
    return row


def _counted(task: RandomTask, seconds: float, wall: float, queue: SimpleQueue[dict[str, Any]]) -> None:
    """Run one task; the system ends the process after so many seconds of processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + seconds), resource.RLIM_INFINITY))
    queue.put(run(task, wall))


def summary(rows: list[dict[str, str]]) -> str:
    """Return the figures of every machine, without and with speed limits."""
    lines = [f"{'machine':12s} speed  tasks solved verified polished  +verified  median s  largest s  wrong"]
    for machine in TASKS:
        for speed in ("0", "1"):
            own = [row for row in rows if row["task"].startswith(machine) and row["speed"] == speed]
            if not own:
                continue
            solved = [row for row in own if row["status"] == "SOLVED"]
            polished = [row for row in solved if row["polished"] == "1"]
            seconds = [float(row["cpu_s"]) for row in solved if row["cpu_s"]]
            # A polished motion that takes longer than the coarse one by more than rounding is another optimum.
            wrong = [row for row in polished if float(row["t_polished"]) > float(row["t_f"]) * (1 + 1e-6)]
            lines.append(
                f"{machine:12s} {speed:>5s}  {len(own):5d} {len(solved):6d} "
                f"{sum(row['verified'] == '1' for row in solved):8d} {len(polished):8d}  "
                f"{sum(row['polish_verified'] == '1' for row in polished):9d}  {np.median(seconds or [0]):8.2f}  "
                f"{np.max(seconds or [0]):9.2f}  {len(wrong):5d}"
            )
    return "\n".join(lines)


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", help="CSV file; tasks that stand in it are not solved again")
    parser.add_argument("--tasks", type=int, default=60, help="tasks of each machine (60)")
    parser.add_argument("--every", type=int, default=1, help="only every so manyth task of each machine (1)")
    parser.add_argument("--machines", nargs="+", default=list(TASKS), choices=list(TASKS))
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of processor time after which a task is ended (60)"
    )
    parser.add_argument("--wall", type=float, default=9.0, help="seconds of processor time given to polish (9)")
    return parser.parse_args()


if __name__ == "__main__":
    main()
