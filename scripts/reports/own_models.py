"""Machines and effects in a Python file of the user, made known to scene files by the option --with."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

from models.scenes import catalogue
from models.scenes.toml_document import SceneError


def add_own_models(parser: argparse.ArgumentParser) -> None:
    """Give a command the option --with."""
    parser.add_argument(
        "--with", dest="own", type=Path, action="append", default=[], metavar="FILE.py",
        help="Python file with machines and effects of your own, which scene files then know by name; it is run",
    )  # fmt: skip


def include_own_models(options: argparse.Namespace) -> None:
    """Run the files that were named by --with, and include their machines and effects.

    Raises:
        SceneError: a file cannot be read, raises, or has nothing to include; one sentence.
    """
    for path in options.own:
        name = path.stem
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None or not path.is_file():
            raise SceneError(f"--with {path}: cannot be read, expected a Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look their module up
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # the file may fail in any way; the message says how
            raise SceneError(f"--with {path}: {type(error).__name__}: {error}") from None
        try:
            catalogue.include(module)
        except ValueError as error:
            raise SceneError(f"--with {path}: {error}") from None
