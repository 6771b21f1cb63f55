"""Sphinx: pages in Markdown, tutorials and a gallery that run while the site is built, docstrings of the public API."""

import re
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

project = "Hamel"
author = "the authors of Hamel"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]
html_theme = "furo"
html_title = "Hamel"
html_show_search_summary = False  # summaries are fetched, which browsers refuse to pages on disk; results need none
exclude_patterns = ["_build", "tutorials", "gallery"]
master_doc = "index"
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]
nitpicky = True  # a reference to nothing is a warning, and warnings are errors
nitpick_ignore = [("py:exc", "UnidentifiedError"), ("py:class", "numpy.ndarray")]
suppress_warnings = ["config.cache", "myst.header"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_use_rtype = False
HERE = Path(__file__).parent
sphinx_gallery_conf = {
    "examples_dirs": [str(HERE / "tutorials"), str(HERE / "gallery")],
    "gallery_dirs": ["tutorials_built", "gallery_built"],
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "remove_config_comments": True,
    "ignore_pattern": r"scara\.py",
}
# Docstrings are plain text: what reStructuredText would take for markup is escaped, and a paragraph with an equation
# keeps its lines.
MARKUP = re.compile(r"([*|`\\])|(?<=\w)(_)(?=\W|$)")
CODE = re.compile(r"`([^`]+)`")
SECTION = re.compile(r"(Args|Returns|Raises|Yields|Source|Attributes):")
EQUATION = re.compile(r"\s*[\w'()\[\]{} .^/+*-]+ (=|<=|>=) \S")


def escaped(row):
    """Return a line with markup escaped, and what stands between backticks as code."""
    parts = CODE.split(row)
    return "".join(f"``{part}``" if k % 2 else MARKUP.sub(r"\\\g<0>", part) for k, part in enumerate(parts))


def plain_text(app, what, name, obj, options, lines):
    """Escape markup in a docstring, and keep the lines of paragraphs with equations."""
    if what in ("property", "attribute") and lines:
        lines[0] = lines[0].replace(": ", " -- ")  # napoleon takes what stands before a colon for a type
    results, inside = [], False
    for number, paragraph in enumerate("\n".join(lines).split("\n\n")):
        rows = [escaped(row) for row in paragraph.split("\n")]
        inside = inside or any(SECTION.match(row) for row in rows)
        kept = number > 0 and not inside and any(EQUATION.match(row) for row in rows)
        results += [f"| {row.strip()}" if kept and row.strip() else row for row in rows] + [""]
    lines[:] = results


def setup(app):
    """Connect the treatment of docstrings before napoleon reads their sections."""
    app.connect("autodoc-process-docstring", plain_text, priority=400)
