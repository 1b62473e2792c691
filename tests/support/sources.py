"""The text of the three packages, for rules over all of it; parsing is most of the work, so few files are."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("mavproxy_uavapi", "mavproxy_vision", "mavproxy_gradys")


@cache
def texts() -> dict[str, str]:
    """By path in the project, the text of each file of Python of the three packages."""
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    return {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in files}


def trees(pattern: str) -> dict[str, ast.Module]:
    """The files in whose text `pattern` is found, parsed."""
    return {name: ast.parse(text) for name, text in texts().items() if re.search(pattern, text)}


def classes() -> list[tuple[str, str]]:
    """Each class of the three packages, as file and name."""
    return [(file, name) for file, text in texts().items() for name in re.findall(r"(?m)^ *class (\w+)", text)]
