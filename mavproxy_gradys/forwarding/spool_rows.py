"""Converts a reading to a row of the spool's file, and back. Pure.

A row may be damaged by a flash chip or another program. So rows are checked like data from outside.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from typing import Any

from mavproxy_gradys.forwarding.quantities import LONGEST_TEXT, NAME
from mavproxy_gradys.forwarding.readings import Reading, Stored

COLUMNS = "seq, device, system, quantity, representation, value, time"
ROW_OVERHEAD = 100  # bytes of a row besides its texts, about
LONGEST_JSON = 16 * LONGEST_TEXT  # bytes; a character needs at most 12


def row_of(reading: Reading) -> tuple[Any, ...]:
    """All of `COLUMNS` except the number.

    Raises:
        ValueError: JSON cannot represent the value.
    """
    value = json.dumps(reading.value, allow_nan=False)
    return (reading.device, reading.system, reading.quantity, reading.representation, value, float(reading.time))


def size_of(row: Sequence[Any]) -> int:
    """The size of a row of `row_of`, bytes."""
    return ROW_OVERHEAD + sum(len(cell) for cell in row if isinstance(cell, str))


def stored_of(row: Sequence[Any]) -> Stored | None:
    """The reading of a row of `COLUMNS`; None if the row is damaged."""
    seq, device, system, quantity, representation, value, time = row
    if not (is_name(device) and is_name(quantity) and is_text(representation) and is_time(time)):
        return None
    if not isinstance(system, int) or not isinstance(value, str) or len(value) > LONGEST_JSON or not value.isascii():
        return None
    try:
        value_read = json.loads(value)
    except (ValueError, RecursionError):
        return None
    return (
        Stored(seq, Reading(device, system, quantity, representation, value_read, time))
        if is_value(value_read)
        else None
    )


def is_storable(reading: Reading) -> bool:
    """Whether the reading can be restored from its row."""
    try:
        return stored_of((0, *row_of(reading))) is not None
    except ValueError:
        return False


def is_name(cell: Any) -> bool:
    """Whether it is a name of a device or a quantity."""
    return isinstance(cell, str) and re.fullmatch(NAME, cell) is not None


def is_text(cell: Any) -> bool:
    """Whether it is a unit or a type; an unpaired surrogate is invalid."""
    return isinstance(cell, str) and len(cell) <= LONGEST_TEXT and cell.encode(errors="replace").decode() == cell


def is_time(cell: Any) -> bool:
    """Whether it is a time."""
    return isinstance(cell, float) and math.isfinite(cell)


def is_value(value: Any) -> bool:
    """Whether a JSON value is the value of a reading."""
    return isinstance(value, str) or all(map(is_number, value if isinstance(value, list) else [value]))


def is_number(value: Any) -> bool:
    """Whether it is a finite number, true or false."""
    return isinstance(value, float) and math.isfinite(value) or isinstance(value, int) and abs(value) < 2**64
