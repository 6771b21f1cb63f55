"""One entry for all commands: hamel COMMAND ..., each with the options of the script of the same name."""

from __future__ import annotations

import difflib
import importlib
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from reports.command import exit_with

# command -> (module, arguments that it stands for, what it does)
COMMANDS: dict[str, tuple[str, tuple[str, ...], str]] = {
    "time-optimal": ("time_optimal", (), "the fastest motion of a scene: solve, verify, draw, report"),
    "torques": ("torques", (), "drive torques of a given motion"),
    "study": ("study", (), "many cases of a scene, stored and resumed"),
    "accuracy": ("accuracy", (), "what an accuracy costs in seconds"),
    "budget": ("time_optimal", ("--budget",), "what each effect of a scene costs"),
    "card": ("time_optimal", ("--card",), "what a scene is, before it is solved"),
    "template": ("time_optimal", ("--template",), "a commented scene file of a machine"),
    "benchmark": ("benchmark", (), "set-up and solve against other tools"),
    "stability": ("stability", (), "the stability suite"),
}
EXAMPLES = """examples:
  hamel template torus > arm.toml
  hamel card arm.toml
  hamel time-optimal arm.toml --polish --report
  hamel torques results/time_optimal.npz arm.toml --report --force
  hamel study study.toml --jobs 2

hamel COMMAND --help lists the options of a command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; its exit status, 0 for help, 2 for no such command."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(_help())
        return 0 if given else 2
    if given[0] == "--version":
        print(_version())
        return 0
    name, *rest = given
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, 1)
        advice = f"; did you mean {near[0]}?" if near else ""
        print(f"hamel: no command {name!r}; there are {', '.join(COMMANDS)}{advice}", file=sys.stderr)
        return 2
    module, options, _ = COMMANDS[name]
    sys.argv = [f"hamel {name}", *rest]
    options = () if {"-h", "--help"} & set(rest) else options
    status: int = importlib.import_module(module).main([*options, *rest])
    return status


def _version() -> str:
    try:
        return f"hamel {version('hamel')}, casadi {version('casadi')}"
    except PackageNotFoundError:
        return f"hamel from its folder, casadi {version('casadi')}"


def _help() -> str:
    width = max(map(len, COMMANDS)) + 2
    lines = [f"  {name:<{width}}{words}" for name, (_, _, words) in COMMANDS.items()]
    called = "python scripts/hamel.py" if Path(sys.argv[0]).name == "hamel.py" else "hamel"
    text = "\n".join(["usage: hamel COMMAND ...", "", "commands:", *lines, "", EXAMPLES])
    return text.replace("hamel ", f"{called} ")


if __name__ == "__main__":
    exit_with(main)
