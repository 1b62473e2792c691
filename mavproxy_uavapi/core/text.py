"""Text that somebody else wrote, made fit for a console, a log and the audit trail. Pure."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

LONGEST = 200  # characters of a text that the trail keeps
MOST = 10  # items of a list
MOST_MEMBERS = 30  # of a mapping


def escaped(text: str) -> str:
    """`text` in one line, with what a terminal would obey, or nobody could see, spelled out: ESC is `\\x1b`."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def nearest(word: str, known: Iterable[str]) -> str:
    """The end of an error about a word that nobody knows: the nearest one that is known, or else all of them."""
    names = list(known)
    near = difflib.get_close_matches(word.lower(), names, n=1)
    return f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"


def cut(value: Any) -> Any:
    """`value` with what is too long cut, to any depth; what was cut is said in its place."""
    if isinstance(value, str) and len(value) > LONGEST:
        return f"{value[:LONGEST]}… ({len(value)} characters)"
    if isinstance(value, Mapping):
        kept = {cut(name): cut(value[name]) for name in list(value)[:MOST_MEMBERS]}
        return kept if len(value) <= MOST_MEMBERS else {**kept, "…": f"({len(value)} members)"}
    if isinstance(value, list | tuple):
        kept_items = [cut(item) for item in value[:MOST]]
        return kept_items if len(value) <= MOST else [*kept_items, f"… ({len(value)} items)"]
    return value
