"""Parses the query of a URL. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mavproxy_gradys.station.reading_row import LATEST, finite, whole
from mavproxy_gradys.station.store import HistoryQuery, ReadingQuery

MOST_ROWS = 1_000_000
MOST_EXPORTED = 100_000_000
MOST_BUCKETS = 4000
MOST_ELEMENTS = 1000


def reading_query(query: Mapping[str, str], limit: int, most: int) -> ReadingQuery:
    """Parse device, quantity, after, from, to, limit.

    Args:
        query: the query of the URL.
        limit: the default of `limit`.
        most: the largest `limit`.

    Raises:
        ValueError: a value is invalid.
    """
    row_limit = whole(query.get("limit", limit))
    if not 0 <= row_limit <= most:
        raise ValueError(f"limit must be from 0 to {most}")
    device, quantity = name(query, "device"), name(query, "quantity")
    start, end = moment(query, "from", -math.inf), moment(query, "to", math.inf)
    return ReadingQuery(device, quantity, max(whole(query.get("after", "-1")), -1), start, end, row_limit)


def history_query(query: Mapping[str, str], now: float) -> HistoryQuery:
    """Parse device, quantity, element, from, to, parts; the default is the hour before `now`.

    Raises:
        ValueError: a value is invalid.
    """
    end = moment(query, "to", now)
    start = moment(query, "from", end - 3600)
    parts, element = whole(query.get("parts", "800")), query.get("element", "")
    if not 1 <= parts <= MOST_BUCKETS:
        raise ValueError(f"parts must be from 1 to {MOST_BUCKETS}")
    if not start < end:
        raise ValueError("from must be before to")
    number = whole(element) if element else None
    if number is not None and not 0 <= number < MOST_ELEMENTS:
        raise ValueError(f"element must be from 0 to {MOST_ELEMENTS - 1}")
    return HistoryQuery(name(query, "device"), name(query, "quantity"), number, start, end, parts)


def name(query: Mapping[str, str], key: str) -> str:
    """A name; empty if it is missing.

    Raises:
        ValueError: no name has these characters.
    """
    text = query.get(key, "")
    if "\0" in text:
        raise ValueError(f"{key} has a NUL")
    text.encode()
    return text


def moment(query: Mapping[str, str], key: str, default: float) -> float:
    """A time, s since 1970.

    Raises:
        ValueError: it is not a valid time.
    """
    if key not in query:
        return default
    at = finite(query[key])
    if not 0 <= at < LATEST:
        raise ValueError(f"{key} is not a valid time")
    return at
