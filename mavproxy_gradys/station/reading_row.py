"""Checks a received reading and makes a row for a store. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT
from mavproxy_gradys.forwarding.spool_rows import LONGEST_JSON, is_value

LONGEST_NAME = 200  # characters of a device, an id or a quantity; an index entry is limited to 2700 bytes
LATEST = 253402300800.0  # s since 1970 of the year 10000
COLUMNS = ("device", "seq", "id", "quantity", "representation", "value", "time", "received")


class NumberTaken(ValueError):
    """The station has another reading of the same device, time and number."""

    def __init__(self, device: str, seq: int) -> None:
        super().__init__(f"{device:.60} has another reading with the number {seq} at that time")


class ReadingRow(NamedTuple):
    """One reading.

    Attributes:
        device, id, quantity, representation: as received.
        seq: its number, 64 bits.
        value: JSON in ASCII.
        number: the value as a number; None for a text or a list.
        time: when it was measured, s since 1970.
    """

    device: str
    seq: int
    id: str
    quantity: str
    representation: str
    value: str
    number: float | None
    time: float


def decoded(payload: Any) -> Any:
    """The JSON value of a message.

    Raises:
        ValueError: it is none.
    """
    try:
        return json.loads(payload)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError("it is not JSON") from error


def reading_row(reading: Any) -> ReadingRow:
    """The row of a decoded JSON value.

    Raises:
        ValueError: it is not a reading.
    """
    if not isinstance(reading, Mapping):
        raise ValueError("not a reading: it is no JSON object")
    missing = [name for name in ("value", "seq", "device", "quantity", "time") if name not in reading]
    if missing:
        raise ValueError(f"not a reading: it has no {missing[0]}")
    value, seq, time = reading["value"], reading["seq"], reading["time"]
    if not isinstance(seq, int) or not isinstance(time, int | float) or bool in map(type, (seq, time)):
        raise ValueError(f"seq {seq!r:.40} or time {time!r:.40} is not a number")
    at = finite(time)
    device, quantity = (text(reading[name], LONGEST_NAME) for name in ("device", "quantity"))
    number, unit = ("" if reading.get(name) is None else reading[name] for name in ("id", "representation"))
    if not 0 <= at < LATEST:
        raise ValueError(f"{at:g} is not a valid time")
    return ReadingRow(
        device,
        whole(seq),
        text(number, LONGEST_NAME),
        quantity,
        text(unit, LONGEST_TEXT),
        value_json(value),
        number_of(value),
        at,
    )


def value_json(value: Any) -> str:
    """A value as JSON.

    Raises:
        ValueError: it is not a valid value; see docs/gradys.md.
    """
    if not is_value(value):
        raise ValueError("its value is not a finite number, a text, true, false, or a list of numbers")
    encoded = json.dumps(value, allow_nan=False)
    if len(encoded) > LONGEST_JSON:
        raise ValueError(f"its value is longer than {LONGEST_JSON} bytes")
    return encoded


def number_of(value: Any) -> float | None:
    """A value as a number; None for a text or a list."""
    return float(value) if isinstance(value, int | float) else None


def text(cell: Any, longest: int) -> str:
    """A text that every store accepts; a whole number is one, too.

    Raises:
        ValueError: it is neither, is too long, or has a NUL or an unpaired surrogate.
    """
    if not isinstance(cell, str | int) or isinstance(cell, bool):
        raise ValueError(f"{cell!r:.40} is not a text")
    characters = str(cell)
    if len(characters) > longest or "\0" in characters:
        raise ValueError(f"{characters!r:.40} is longer than {longest} characters, or has a NUL")
    if characters.encode(errors="replace").decode() != characters:
        raise ValueError(f"{characters!r:.40} has half of a surrogate pair")
    return characters


def whole(number: Any) -> int:
    """A 64-bit integer.

    Raises:
        ValueError: it is not an integer, or too large.
    """
    integer = int(number)
    if not -(2**63) <= integer < 2**63:
        raise ValueError(f"{number!r:.40} is too large")
    return integer


def finite(number: Any) -> float:
    """A finite number.

    Raises:
        ValueError: it is not a number, NaN, or infinite.
    """
    try:
        real = float(number)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{number!r:.40} is not a number") from error
    if not math.isfinite(real):
        raise ValueError(f"{number!r:.40} is not finite")
    return real
