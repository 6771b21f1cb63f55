"""An HTML page in one file: text, tables and Plotly figures, with the script of Plotly inside."""

from __future__ import annotations

import html
import json
import platform
import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from reports.output import NEEDS_PLOTLY

from ocp.numerics.files import written_whole

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2733; max-width: 1280px; margin: 0 auto; padding: 1rem 1.5rem; }
h1 { font-size: 1.5rem; margin: 0.6rem 0; } h2 { font-size: 1.15rem; margin: 1.6rem 0 0.4rem; }
.verdict { padding: 0.6rem 0.9rem; border-left: 6px solid #009e73; background: #eef8f4; font-size: 1.05rem; }
.verdict.bad { border-color: #b03a2e; background: #fbeeec; }
table { border-collapse: collapse; margin: 0.4rem 0; } .wide { overflow-x: auto; max-height: 32rem; overflow-y: auto; }
th, td { padding: 0.15rem 0.7rem; border-bottom: 1px solid #e5e8eb; text-align: right;
  font-variant-numeric: tabular-nums; }
th { position: sticky; top: 0; background: white; }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
pre { background: #f4f6f8; padding: 0.7rem; overflow-x: auto; font-size: 13px; } figure { margin: 0.3rem 0; }
figcaption, .note { color: #5a6875; font-size: 0.9rem; } details > summary { cursor: pointer; }
tr.chosen td { background: #fff3d6; } tr[data-case] { cursor: pointer; }
"""
CONFIG = {"responsive": True, "displaylogo": False}


def plotly(module: str = "graph_objects") -> Any:
    """Return a module of Plotly.

    Raises:
        ImportError: Plotly is not installed; the message says how to get it.
    """
    try:
        return import_module(f"plotly.{module}")
    except ImportError:
        raise ImportError(NEEDS_PLOTLY) from None


def section(heading: str, *parts: str) -> str:
    """Return a section of a page; empty parts are left out, and a section of nothing is nothing."""
    body = "\n".join(part for part in parts if part)
    return f"<section>\n<h2>{html.escape(heading)}</h2>\n{body}\n</section>" if body else ""


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph of plain text; `kind` is a class of the style, such as "note"."""
    return f'<p class="{kind}">{html.escape(text)}</p>' if text else ""


def verdict(text: str, good: bool) -> str:
    """Return the verdict in a coloured box."""
    return f'<p class="verdict{"" if good else " bad"}">{html.escape(text)}</p>'


def table(header: Sequence[str], rows: Sequence[Sequence[object]], keys: Sequence[int] | None = None) -> str:
    """Return a table; numbers are shown with five digits.

    Args:
        header: of the columns.
        rows: texts or numbers.
        keys: number of the case of each row, which a click on it shows; None for none.
    """
    if not rows:
        return ""
    texts = [any(isinstance(row[c], str) for row in rows) for c in range(len(header))]
    head = "".join(
        f"<th{' class=text' if text else ''}>{html.escape(name)}</th>" for name, text in zip(header, texts, strict=True)
    )
    lines = []
    for k, row in enumerate(rows):
        cells = "".join(
            f'<td class="text">{html.escape(cell)}</td>' if isinstance(cell, str) else f"<td>{_shown(cell)}</td>"
            for cell in row
        )
        lines.append(f"<tr{'' if keys is None else f' data-case={json.dumps(str(keys[k]))}'}>{cells}</tr>")
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def listed(texts: Sequence[str]) -> str:
    """Return sentences as a list; none is nothing."""
    items = "".join(f"<li>{html.escape(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>" if items else ""


def key(colours: Mapping[str, str]) -> str:
    """Return what the colours of lines stand for, name -> colour."""
    marks = (f'<span style="color:{colour}">&#9632;</span> {html.escape(name)}' for name, colour in colours.items())
    return f'<p class="note">{" &ensp; ".join(marks)}</p>'


def figure(drawing: Any, name: str, caption: str = "") -> str:
    """Return a Plotly figure as part of a page.

    Args:
        drawing: a plotly.graph_objects.Figure.
        name: of the element, for links between figures.
        caption: below it, plain text.
    """
    body = drawing.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=CONFIG, auto_play=False)
    return f"<figure>{body}{f'<figcaption>{html.escape(caption)}</figcaption>' if caption else ''}</figure>"


def preformatted(text: str, summary: str = "") -> str:
    """Return text as it stands, folded away under a summary if there is one."""
    body = f"<pre>{html.escape(text)}</pre>"
    return f"<details><summary>{html.escape(summary)}</summary>{body}</details>" if summary else body


def data(name: str, value: object) -> str:
    """Return plain data for the scripts of a page, as window[name]."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return f"<script>window.{name} = {text};</script>"


def versions() -> str:
    """Return the versions of what made a report, and the command, as one line."""
    names = ("hamel", "casadi", "numpy", "plotly")
    parts = [f"{name} {_version(name)}" for name in names]
    made = f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"
    command = f"{Path(sys.argv[0]).name} {shlex.join(sys.argv[1:])}"
    return f"{', '.join(parts)}; {made}; {datetime.now().astimezone():%Y-%m-%d %H:%M %z}; command: {command}"


def write(path: Path, title: str, sections: Sequence[str], scripts: Sequence[str] = ()) -> None:
    """Write a page that needs no other file and no network.

    Args:
        path: of the page (.html).
        title: heading.
        sections: of the page; empty ones are left out.
        scripts: texts in JavaScript, run behind the figures.

    Raises:
        ImportError: Plotly is not installed.
        OSError: the file cannot be written.
    """
    library = plotly("offline").get_plotlyjs()
    heading = html.escape(title)
    body = "\n".join(part for part in sections if part)
    behind = "\n".join(f"<script>{script}</script>" for script in scripts)
    with written_whole(path) as part:
        part.write_text(
            f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{heading}</title>\n'
            f'<meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">\n'
            f"<style>{STYLE}</style>\n<script>{library}</script></head>\n<body>\n<h1>{heading}</h1>\n{body}\n"
            f'<p class="note">{html.escape(versions())}</p>\n{behind}\n</body></html>\n',
            encoding="utf-8",
        )


def keyed(rows: Mapping[str, object]) -> str:
    """Return a table of two columns, name and value."""
    return table(("", ""), [(name, value if isinstance(value, str) else _shown(value)) for name, value in rows.items()])


def _shown(value: object) -> str:
    if isinstance(value, float) or hasattr(value, "dtype"):
        return f"{float(value):.5g}" if value == value else "-"  # type: ignore[arg-type]
    return html.escape(str(value))


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "from its folder"
