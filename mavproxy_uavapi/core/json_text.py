"""Reads JSON that came from outside, strictly. Pure."""

from __future__ import annotations

import json
from typing import Any

from mavproxy_uavapi.core.errors import BadRequest, Invalid

MOST_DIGITS = 30  # of a whole number; a longer one becomes a float, and infinite like 1e400 if it is too large
NEARBY = 20  # characters that an error shows


class _Twice(ValueError):
    """A name that an object has twice."""


def read_json(text: str, what: str = "the body") -> Any:
    """The value of a JSON text, which may begin with a byte order mark.

    NaN and infinities are read, so that the check of each value refuses them.

    Args:
        text: the text.
        what: its subject in an error, such as `the body`.

    Raises:
        BadRequest: it is not JSON, nested too deeply, or half a character stands alone in it.
        Invalid: a name is there twice in one object.
    """
    text = text.removeprefix("\ufeff")
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_int=_whole)
        if "\\ud" in text.lower():
            json.dumps(value, ensure_ascii=False).encode()
    except json.JSONDecodeError as error:
        begin = text[error.pos : error.pos + NEARBY]
        place = f"near {ascii(begin)}" if begin else "where it ends"
        raise BadRequest(f"{what} is not JSON: line {error.lineno}, column {error.colno}, {place}") from error
    except RecursionError as error:
        raise BadRequest(f"{what} is nested too deeply") from error
    except UnicodeEncodeError as error:
        raise BadRequest(f"{what} has half a character (a lone surrogate) in a text") from error
    except _Twice as error:
        raise Invalid("it is there twice", str(error)) from error
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        names = [name for name, _ in pairs]
        raise _Twice(next(name for place, name in enumerate(names) if name in names[:place]))
    return members


def _whole(digits: str) -> int | float:
    return int(digits) if len(digits) <= MOST_DIGITS else float(digits)
