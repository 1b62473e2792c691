"""MAVProxy's console and map, as a recorder: what the windows would show."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


class Console:
    """Remembers each line by name, and how often one was set."""

    def __init__(self) -> None:
        self.lines: dict[str, tuple[str, int]] = {}
        self.count = 0

    def set_status(self, name: str, text: str = "", row: int = 0, fg: str = "black", bg: str = "white") -> None:
        assert fg != bg
        self.lines[name] = text, row
        self.count += 1


class Map:
    """Remembers what is drawn, by key, and how often something was."""

    def __init__(self) -> None:
        self.objects: dict[str, Any] = {}
        self.count = 0

    def add_object(self, shape: Any) -> None:
        self.objects[shape.key] = shape
        self.count += 1

    def remove_object(self, key: str) -> None:
        del self.objects[key]


def open_console(mpstate: SimpleNamespace) -> Console:
    """`module load console`."""
    mpstate.console = Console()
    mpstate.public_modules["console"] = object()
    return mpstate.console


def open_map(mpstate: SimpleNamespace) -> Map:
    """`module load map`."""
    mpstate.map = Map()
    return mpstate.map
