"""A study whose report is tested, and the text of a report."""

from pathlib import Path

LARGEST = 6_000_000  # bytes
STUDY = """
machine = "cylindrical"
[effects.gravity]
[limits]
tau = [150.0, 1000.0, 300.0]
[task]
from = [0.0, 0.2, 0.6]
to = [1.0, 0.5, 0.7]
elements = 8
[study.over]
"parameters.m_3" = [15.0, 20.0]
"limits.tau.factor" = [0.1, 1.0, 1.2]
"""


def text_of(path: Path) -> str:
    """Return a report without the script of Plotly."""
    text = path.read_text(encoding="utf-8")
    return text[text.index("</head>") :]
