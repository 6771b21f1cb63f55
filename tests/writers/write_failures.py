"""Write docs/failures.md from the failing problems: python tests/write_failures.py."""

from __future__ import annotations

import inspect
import textwrap
from pathlib import Path

from catalogue.failing import FAILING

HEAD = """# What Hamel says when it fails

A solve never raises for a problem that cannot be solved: it returns a solution with a `status`, the last iterate and
a `message` in words; IPOPT's own word is kept in `solver_status`. These problems are in `tests/failing.py`, and the
tests compare their messages with this page, which `python tests/write_failures.py` writes.

"""


def main() -> None:
    """Run every problem and write the page."""
    parts = [HEAD]
    for case in FAILING:
        solution = case.run()
        code = textwrap.dedent(inspect.getsource(case.run)).split("\n", 1)[1]
        parts.append(f"## {case.name}\n\n```python\n{textwrap.dedent(code).strip()}\n```\n\n")
        parts.append(f"`{solution.status.name}` (IPOPT: {solution.solver_status})\n\n")
        parts.append(textwrap.fill(solution.message, 116, initial_indent="> ", subsequent_indent="> ") + "\n\n")
    Path("docs/failures.md").write_text("".join(parts).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
