"""An attribute that is worked out when it is asked for, and only then."""

from __future__ import annotations

from typing import Any


class Deferred:
    """A text of a frozen dataclass that may be given as a function without arguments, called at the first access.

    Args:
        name: of the attribute.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, holder: Any, owner: type) -> Any:
        if holder is None:
            return self
        value = holder.__dict__[self._name]
        if not isinstance(value, str):
            value = holder.__dict__[self._name] = value()
        return value

    def __set__(self, holder: Any, value: Any) -> None:
        holder.__dict__[self._name] = value
