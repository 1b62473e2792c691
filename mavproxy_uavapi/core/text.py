"""Foreign text, made safe for a console, a log and the audit trail. Pure."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any

LONGEST_LINE = 2000  # characters of a printed line
LONGEST = 200  # characters of a text that the trail keeps
MOST = 10  # items of a list
MOST_MEMBERS = 30  # of a mapping


def escaped(text: str) -> str:
    """`text` in one line, with control and invisible characters spelled out: ESC is `\\x1b`."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text)


def line_of(text: str) -> str:
    """A text as a line of a terminal, a window or a log: `escaped`, and cut if it is very long."""
    line = escaped(text)
    return line if len(line) <= LONGEST_LINE else f"{line[:LONGEST_LINE]}… ({len(line)} characters)"


def joined(lines: Iterable[str]) -> str:
    """Several lines as one text; a line break within one of them may come from somebody else, and is spelled out."""
    return "\n".join(map(line_of, lines))


def reason_of(error: BaseException) -> str:
    """What the system or another program says of a failure, without Python's numbers; it may be empty."""
    return re.sub(r"\[Errno -?\d+\] ", "", str(error))


def nearest(word: str, known: Iterable[str]) -> str:
    """The end of an error about an unknown word: the nearest known one, or else all of them."""
    names = list(known)
    matches = difflib.get_close_matches(word.lower(), names, n=1)
    return f"did you mean {matches[0]}?" if matches else f"there are {', '.join(names)}"


def cut(value: Any) -> Any:
    """`value` with everything too long cut, to any depth; a note takes the place of what was cut."""
    if isinstance(value, str) and len(value) > LONGEST:
        return f"{value[:LONGEST]}… ({len(value)} characters)"
    if isinstance(value, Mapping):
        members = {cut(name): cut(value[name]) for name in list(value)[:MOST_MEMBERS]}
        return members if len(value) <= MOST_MEMBERS else {**members, "…": f"({len(value)} members)"}
    if isinstance(value, list | tuple):
        items = [cut(item) for item in value[:MOST]]
        return items if len(value) <= MOST else [*items, f"… ({len(value)} items)"]
    return value
