"""Every Python block of the README and of the pages in docs runs as printed, and prints plain numbers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ocp import Study, StudyTable

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(path for path in (ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
SHARED = "All blocks share"  # pages with these words run from top to bottom in one namespace
SLOW = {"docs/failures.md"}  # pages that take more than two seconds


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def blocks(path: Path) -> list[str]:
    return BLOCK.findall(path.read_text(encoding="utf-8"))


def runs() -> list[Any]:
    """Return (page, blocks that run in one namespace) for every page with code."""
    results = []
    for path in PAGES:
        result = blocks(path)
        together = [result] if SHARED in path.read_text(encoding="utf-8") else [[block] for block in result]
        marks = [pytest.mark.slow] if name(path) in SLOW else []
        results += [
            pytest.param(path, run, id=f"{name(path)}-{number}", marks=marks)
            for number, run in enumerate(together)
            if run
        ]
    return results


@pytest.mark.parametrize(("path", "run"), runs())
def test_blocks_run_as_printed(
    path: Path, run: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": __name__}  # the module of a dataclass must exist while it is made
    for number, block in enumerate(run, 1):
        exec(compile(block, f"{name(path)}, block {number}", "exec"), names)
    printed = capsys.readouterr().out
    assert "np." not in printed, printed
    assert "not verified" not in printed, printed
    if isinstance(names.get("study"), Study):
        check_study(names["table"], printed)


def check_study(table: StudyTable, printed: str) -> None:
    """Check that all cases are solved, and that a heavier load and weaker drives take longer."""
    assert f"{len(table)} cases: {len(table)} solved" in printed
    durations = table.grid("duration")
    assert np.all(np.diff(durations, axis=0) > 0.0)
    assert np.all(np.diff(durations, axis=1) < 0.0)


def test_no_page_hides_a_block_from_this_test() -> None:
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        left_out = text.count("```python no-run")
        assert len(re.findall(r"^ *```python", text, re.MULTILINE)) == len(blocks(path)) + left_out, name(path)


def test_every_page_stands_in_the_index() -> None:
    listed = (ROOT / "docs" / "index.md").read_text(encoding="utf-8").splitlines()
    pages = [path.stem for path in (ROOT / "docs").glob("*.md") if path.stem != "index"]
    assert [page for page in pages if page not in listed] == []
