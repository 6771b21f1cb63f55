"""Write docs/catalogue.md, published problems by default and refined: python tests/writers/write_catalogue.py."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[2]), str(Path(__file__).resolve().parents[1])]

from catalogue.published import PUBLISHED, Published  # noqa: E402

from ocp import Ipopt, Share, estimate, solve, solve_to_accuracy  # noqa: E402

HEAD = """# Published problems

Value of the cost (maxima with a negative sign), error and estimated error of `solve(problem)` with its defaults and of
the last step of `solve_to_accuracy(problem, Share(1e-7), seconds=45)`, and CPU seconds.
`python tests/writers/write_catalogue.py [rows.json]` writes this page (measured rows are kept in that file and not
measured again); statements are in `tests/catalogue/published.py`.

An error with "from" is that of another local optimum, to which an estimate refers. F-8: the default finds 5.7286;
`multistart(problem, 12)` finds the published one. Cart-pole: shooting confirms both optima, and the lower one is not
the published one. PROPT's 6.164 of the protein production was found from no start, the value here is our own; PSOPT's
2.1050 of the two masses and 0.610775 of the batch reactor are not what shooting gives. Values of both least-time
problems of Maurer could not be compared with their source.

Open: the default grid does not resolve the alp rider, which its estimate says, and refinement does not cure it; the
shuttle finds no motion from the smooth guess, whose height and speed become negative; the protein production reaches
the limit of the default solve, not that of the refined one. All rows but three come from one run beside other work:
seconds are those of the processor, budgets those of the clock.

| problem | published | default: error | estimate | s | refined: error | estimate | s | source |
|---|---|---|---|---|---|---|---|---|
"""


def row(name: str, known: Published, default: tuple[str, ...], refined: tuple[str, ...]) -> str:
    """Return a row of the table."""
    return f"| {name} | {known.value:.12g} | {' | '.join(default)} | {' | '.join(refined)} | {known.source} |\n"


def error(known: Published, cost: float) -> str:
    """Return the error of a cost; if another optimum than the published one is nearest, from that one."""
    nearest = known.nearest(cost)
    return f"{abs(cost - nearest):.1e}" + ("" if nearest == known.value else f" (from {nearest:.6g})")


def measured(known: Published) -> list[list[str]]:
    """Return error, estimate and CPU seconds of the default solve and of the refined one."""
    problem, begun = known.make(), time.process_time()
    solution = solve(problem, solver=Ipopt(max_seconds=60.0, progress=False))
    spent, begun = time.process_time() - begun, time.process_time()
    last = list(solve_to_accuracy(problem, Share(1e-7), solver=Ipopt(progress=False), seconds=45.0))[-1]
    again = time.process_time() - begun
    return [
        [error(known, one.cost), f"{estimate(one).cost:.1e}", f"{seconds:.1f}"]
        if one.ok
        else [one.status.name, "", f"{seconds:.1f}"]
        for one, seconds in ((solution, spent), (last, again))
    ]


def main() -> None:
    """Measure and write; problems that stand in the file of rows are not measured again."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    kept = json.loads(path.read_text(encoding="utf-8")) if path is not None and path.exists() else {}
    for name, known in PUBLISHED.items():
        if name not in kept:
            kept[name] = measured(known)
            print(name, *kept[name], flush=True)
        if path is not None:
            path.write_text(json.dumps(kept), encoding="utf-8")
    rows = [row(name, known, *map(tuple, kept[name])) for name, known in PUBLISHED.items()]
    Path("docs/catalogue.md").write_text(HEAD + "".join(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
