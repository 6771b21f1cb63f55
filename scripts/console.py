"""The console command `hamel`, which an installation offers; the same as python scripts/hamel.py.

Installed, the commands lie in a package of their own, hamel_commands. Their folder is searched for modules in the
process of the command only, so that no general name, such as reports or study, is taken from other packages.
"""

from __future__ import annotations

import sys
from pathlib import Path


def run() -> None:
    """Run `hamel COMMAND ...` and leave Python with its exit status."""
    sys.path.insert(0, str(Path(__file__).resolve().parent))
    from hamel import main
    from reports.command import exit_with

    exit_with(main)
