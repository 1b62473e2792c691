"""A reading as it comes from outside, checked, as a row of a store. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from mavproxy_gradys.forwarding.readings import LONGEST_TEXT
from mavproxy_gradys.forwarding.spool_rows import LONGEST_JSON, is_value

LONGEST_NAME = 200  # letters of a device, an id or a quantity: an index takes no more than 2700 bytes
LATEST = 253402300800.0  # s since 1970 of the year 10000
COLUMNS = ("device", "seq", "id", "quantity", "representation", "value", "time", "received")


class ReadingRow(NamedTuple):
    """One reading.

    Attributes:
        device, id, quantity, representation: as it was sent.
        seq: its number, of 64 bits.
        value: JSON, in ASCII.
        number: the value as a number; None when it is a text or a list.
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


def reading_row(reading: Any) -> ReadingRow:
    """The row of what JSON gave.

    Raises:
        ValueError: it is no reading.
    """
    if not isinstance(reading, Mapping):
        raise ValueError(f"not a reading: {type(reading).__name__}")
    try:
        value, seq = reading["value"], reading["seq"]
        names = [text(reading[name], LONGEST_NAME) for name in ("device", "quantity")]
        at = finite(reading["time"])
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"not a reading: {error!r:.80}") from error
    if not isinstance(seq, int) or isinstance(seq, bool):
        raise ValueError(f"seq {seq!r:.40} is no number")
    if not 0 <= at < LATEST:
        raise ValueError(f"{at:g} is no time")
    device, quantity = names
    representation = text(reading.get("representation", ""), LONGEST_TEXT)
    return ReadingRow(
        device,
        whole(seq),
        text(reading.get("id", ""), LONGEST_NAME),
        quantity,
        representation,
        value_json(value),
        number_of(value),
        at,
    )


def value_json(value: Any) -> str:
    """A value as JSON.

    Raises:
        ValueError: it is none: see docs/gradys.md.
    """
    if not is_value(value):
        raise ValueError("its value is no finite number, text, true, false, or list of numbers")
    encoded = json.dumps(value, allow_nan=False)
    if len(encoded) > LONGEST_JSON:
        raise ValueError(f"its value is longer than {LONGEST_JSON} bytes")
    return encoded


def number_of(value: Any) -> float | None:
    """A value as a number; None when it is a text or a list."""
    return float(value) if isinstance(value, int | float) else None


def text(cell: Any, longest: int) -> str:
    """A text that every store takes.

    Raises:
        ValueError: it is too long, has a NUL, or half a letter.
    """
    letters = str(cell)
    if len(letters) > longest or "\0" in letters:
        raise ValueError(f"{letters!r:.40} is longer than {longest} letters, or has a NUL")
    letters.encode()
    return letters


def whole(number: Any) -> int:
    """An integer of 64 bits.

    Raises:
        ValueError: it is none.
    """
    integer = int(number)
    if not -(2**63) <= integer < 2**63:
        raise ValueError(f"{number!r:.40} is too large")
    return integer


def finite(number: Any) -> float:
    """A number.

    Raises:
        ValueError: it is none, NaN, or infinite.
    """
    real = float(number)
    if not math.isfinite(real):
        raise ValueError(f"{number!r:.40} is not finite")
    return real
