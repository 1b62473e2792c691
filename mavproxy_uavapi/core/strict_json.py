"""JSON that means one thing: no name twice, no number that only Python can hold, no half characters. Pure."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from typing import Any

from mavproxy_uavapi.core.errors import BadRequest, Invalid
from mavproxy_uavapi.core.text import escaped

DEEPEST = 60  # lists and objects in each other
LONGEST_WHOLE = 40  # digits; a longer number is a float, and infinite beyond 308
LARGEST = 1 << 1023  # of whole numbers; a float cannot hold one much larger
LONGEST_SHOWN = 30  # characters
MARK = re.compile(r'\\.|["\[\]{}]', re.DOTALL)
HALF = re.compile(r"\\u[dD][89a-fA-F]")  # a surrogate, which means a character only with another one


def json_of(text: str, what: str) -> Any:
    """The value of a JSON text; `what` begins the errors. NaN and infinities are floats: who uses them refuses them.

    Raises:
        BadRequest: it is not JSON, and where; it is nested too deeply, or a text in it is no characters.
        Invalid: an object has a name twice.
    """
    _require_shallow(text, what)

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        body = dict(pairs)
        if len(body) < len(pairs):
            twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
            raise Invalid(f"{what} has the name {shown(twice)} twice in one object, with {shown(', '.join(body))}")
        return body

    try:
        value = json.loads(text, object_pairs_hook=members, parse_int=_whole)
    except json.JSONDecodeError as error:
        rest = shown(text[error.pos :]) if text[error.pos :].strip() else "the end"
        raise BadRequest(f"{what} is not JSON: line {error.lineno}, column {error.colno} has {rest}") from error
    if HALF.search(text):
        _require_characters(value, what)
    return value


def is_finite_number(value: Any) -> bool:
    """Whether it is a number that a float can hold; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) if isinstance(value, float) else abs(value) < LARGEST


def shown(value: Any) -> str:
    """A foreign value as an error quotes it: in one line, and cut."""
    text = json.dumps(value, ensure_ascii=False, default=str) if not isinstance(value, str) else f"'{value}'"
    return escaped(text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}…")


def _require_shallow(text: str, what: str) -> None:
    """Raise BadRequest if lists and objects are in each other too deeply: what walks them later would fail."""
    if text.count("[") + text.count("{") <= DEEPEST:
        return
    depth, in_string = 0, False
    for match in MARK.finditer(text):
        mark = match[0]
        if mark == '"':
            in_string = not in_string
        elif not in_string and mark in "[{":
            depth += 1
            if depth > DEEPEST:
                raise BadRequest(f"{what} is nested more than {DEEPEST} levels deep")
        elif not in_string and mark in "]}":
            depth -= 1


def _whole(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_WHOLE else float(digits)


def _require_characters(value: Any, what: str) -> None:
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise BadRequest(f"{what} has half of a surrogate pair (\\ud800 to \\udfff) in a text") from error
