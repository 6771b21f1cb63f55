"""Time-optimal motions of robots: seconds, iterations, what is verified and polished. Results go to a JSON file.

    python scripts/benchmark_arms.py results.jsonl --tasks 20

A run that was interrupted continues: motions that stand in the file are not solved again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.arm_motions import named_motions, random_motions, run_named, run_random, tables


def main() -> None:
    """Run the motions that the file lacks, then print the tables of the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("results", type=Path, help="file of results, one JSON object a line")
    parser.add_argument("--tasks", type=int, default=20, metavar="N", help="random tasks of each robot (default 20)")
    parser.add_argument("--seconds", type=float, default=30.0, help="of processor time for each polish (default 30)")
    parser.add_argument("--only", nargs="+", default=[""], metavar="NAME", help="motions whose names begin with these")
    options = parser.parse_args()
    done = {row["name"] for row in _rows(options.results)}
    for motions, run in ((named_motions(), run_named), (random_motions(options.tasks), run_random)):
        for motion in motions:
            if motion.name in done or not motion.name.startswith(tuple(options.only)):
                continue
            row = {"name": motion.name, **run(motion, options.seconds)}
            with options.results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(json.dumps(row), flush=True)
    print(tables(_rows(options.results)))


def _rows(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


if __name__ == "__main__":
    main()
