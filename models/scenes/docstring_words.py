"""What the arguments of a function or a dataclass mean, read from the section Args of its docstring."""

from __future__ import annotations

import inspect
import re

ENTRY = re.compile(r"    ([A-Za-z_]\w*(?:, [A-Za-z_]\w*)*): (.*)")
PLAIN = re.compile(r"[a-z ]+")
UNIT = re.compile(r"\s*\[[^\]]*\]\.?$")
LONGEST = 84  # characters of an explanation beside a value


def argument_words(thing: object) -> dict[str, str]:
    """Return name -> explanation of every argument, without its unit; a short one, for the margin of a file.

    Args:
        thing: with a docstring whose section Args has lines such as "m_2, m_3: masses of the links [kg].".
    """
    lines = (inspect.getdoc(thing) or "").splitlines()
    if "Args:" not in lines:
        return {}
    words: dict[str, str] = {}
    names: list[str] = []
    subject = ""  # of the entry before, for "of the arm" after "masses of the links"
    for line in lines[lines.index("Args:") + 1 :]:
        entry = ENTRY.fullmatch(line)
        if entry:
            names, text = entry.group(1).split(", "), entry.group(2)
            text = f"{subject} {text}" if text.startswith("of ") and PLAIN.fullmatch(subject) else text
            subject = text.partition(" of ")[0]
            words |= dict.fromkeys(names, text)
        elif line.startswith("     ") and names:
            words |= {name: f"{words[name]} {line.strip()}" for name in names}
        elif line.strip():
            break
    return {name: _short(text) for name, text in words.items()}


def argument_units(thing: object) -> dict[str, str]:
    """Return name -> unit of every argument whose explanation ends with one in brackets."""
    units: dict[str, str] = {}
    for names, text in re.findall(r"(?m)^ +(\w+(?:, \w+)*): .*?\[([^\]]*)\]\.?$", inspect.getdoc(thing) or ""):
        units |= dict.fromkeys(names.split(", "), text)
    return units


def _short(text: str) -> str:
    """Return an explanation without its unit, cut at the end of a part if it is long."""
    text = UNIT.sub("", text).rstrip(".")
    for mark in ("; ", ": ", " (", ", "):
        while len(text) > LONGEST and mark in text:
            text = UNIT.sub("", text.rpartition(mark)[0])
    return text if len(text) <= LONGEST else text[:LONGEST].rpartition(" ")[0] + " ..."
