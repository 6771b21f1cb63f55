"""Write docs/failures.md from the problems of the catalogue that fail: python tests/writers/write_failures.py."""

from __future__ import annotations

import inspect
import sys
import textwrap
from pathlib import Path

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from catalogue import failing

PAGE = Path(__file__).resolve().parents[2] / "docs" / "failures.md"
HEAD = """# Why did my problem not solve?

A solve never raises for a problem that cannot be solved: it returns a solution with a `status`, the last iterate and
a `message` in words; the status of IPOPT is kept in `solver_status`. The problems below fail on purpose, or barely
solve. They are in `tests/catalogue/failing.py`; `python tests/writers/write_failures.py` solves them and writes this
page, and the tests compare the messages.

All blocks share these names:

```python
{names}
```

"""


def shared() -> str:
    """Return the imports, the numbers and the system that all problems of the catalogue use."""
    source = inspect.getsource(failing)
    imports = source[source.index("import casadi") : source.index("FROM, TO")]
    numbers = source[source.index("FROM, TO") : source.index("@dataclass")]
    return (
        f"from dataclasses import replace\n\n{imports}{numbers.rstrip()}\n\n\n{inspect.getsource(failing.arm)}".strip()
    )


def block(case: failing.Failing) -> str:
    """Return the body of the function of a problem, its result named `solution`."""
    body = textwrap.dedent(inspect.getsource(case.run).split("\n", 1)[1]).strip()
    head, _, last = body.rpartition("return ")
    return f"{head}solution = {last}"


def main() -> None:
    """Run every problem and write the page."""
    parts = [HEAD.format(names=shared())]
    for case in failing.FAILING:
        solution = case.run()
        parts.append(f"## {case.name}\n\n```python\n{block(case)}\nprint(solution.message)\n```\n\n")
        parts.append(f"`{solution.status.name}` (IPOPT: {solution.solver_status})\n\n")
        parts.append(textwrap.fill(solution.message, 116, initial_indent="> ", subsequent_indent="> ") + "\n\n")
    PAGE.write_text("".join(parts).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
