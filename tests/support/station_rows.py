"""Rows of a station's stores."""

from __future__ import annotations

from typing import Any

from mavproxy_gradys.station.reading_row import ReadingRow, reading_row


def row(seq: int, **members: Any) -> ReadingRow:
    """A height of 1.5 m from uav-1, its number in seconds after 1_699_999_000; `members` are what differs."""
    reading = {"device": "uav-1", "id": "1", "seq": seq, "quantity": "alt", "representation": "m", "value": 1.5}
    return reading_row({**reading, "time": 1_699_999_000 + seq, **members})
