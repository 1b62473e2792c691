"""Converts text that a person writes to a value. Pure, except `path_of`, which looks up home folders."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from mavproxy_uavapi.core.errors import SettingError

TRUE = frozenset({"true", "yes", "on", "1"})
FALSE = frozenset({"false", "no", "off", "0"})
UNSET = frozenset({"", "none", "[]"})
NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"  # float() accepts everything that this matches
WHOLE = r"[-+]?[0-9]{1,9}"


def is_unset(text: str) -> bool:
    """Whether the text stands for "not given": nothing, `None` or `[]`."""
    return text.strip().lower() in UNSET


def words(text: str) -> tuple[str, ...]:
    """`[a, b]`, `a,b` or `a b` -> ("a", "b")."""
    return tuple(word for word in text.strip().strip("[]").replace(",", " ").split() if not is_unset(word))


def boolean(text: str) -> bool:
    """`true`, `yes`, `on`, `1` and their opposites, in any case; anything else is an error.

    Raises:
        ValueError: it is none of them.
    """
    lowered = text.strip().lower()
    if lowered not in TRUE | FALSE:
        raise ValueError("expected true or false")
    return lowered in TRUE


def converted(kind: type, value: object) -> Any:
    """A text, a number or a truth value as a str, bool, int or float.

    Raises:
        ValueError: it cannot be converted. NaN and infinity are not numbers, 1.0 is not whole, and True is neither.
    """
    if not isinstance(value, str | int | float):
        raise ValueError(f"expected a {kind.__name__}")
    text = str(value)
    if kind is str:
        return "" if is_unset(text) else text
    if kind is bool:
        return boolean(text)
    if not re.fullmatch(WHOLE if kind is int else NUMBER, text.strip()):
        raise ValueError(f"expected a {kind.__name__}")
    number = kind(text)
    if not math.isfinite(number):  # 1e400
        raise ValueError("expected a finite number")
    return number


def path_of(text: str, name: str = "") -> Path:
    """The path, with `~` and `~user` expanded; errors begin with `name`, the setting's or the argument's.

    Raises:
        SettingError: no user has that name, or no path can be written so.
    """
    place, loc = (f"{name}: ", [name]) if name else ("", [])
    if "\0" in text:
        raise SettingError(f"{place}no path can hold a zero byte", *loc)
    try:
        return Path(text).expanduser()
    except RuntimeError as error:  # as pathlib reports it
        raise SettingError(f"{place}{text!r}: no such user, or the user has no home folder", *loc) from error
