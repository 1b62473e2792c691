"""What the query of a URL asks for. Pure."""

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
    """device, quantity, after, from, to, limit.

    Args:
        query: the URL's.
        limit: how many readings when it does not say.
        most: how many at most.

    Raises:
        ValueError: it means nothing.
    """
    asked = whole(query.get("limit", limit))
    if not 0 <= asked <= most:
        raise ValueError(f"limit is from 0 to {most}")
    device, quantity = name(query, "device"), name(query, "quantity")
    start, end = moment(query, "from", -math.inf), moment(query, "to", math.inf)
    return ReadingQuery(device, quantity, max(whole(query.get("after", "-1")), -1), start, end, asked)


def history_query(query: Mapping[str, str], now: float) -> HistoryQuery:
    """device, quantity, element, from, to, parts; the hour up to `now` when it does not say.

    Raises:
        ValueError: it means nothing.
    """
    end = moment(query, "to", now)
    start = moment(query, "from", end - 3600)
    parts, element = whole(query.get("parts", "800")), query.get("element", "")
    if not 1 <= parts <= MOST_BUCKETS:
        raise ValueError(f"parts is from 1 to {MOST_BUCKETS}")
    if not start < end:
        raise ValueError("from is before to")
    number = whole(element) if element else None
    if number is not None and not 0 <= number < MOST_ELEMENTS:
        raise ValueError(f"element is from 0 to {MOST_ELEMENTS - 1}")
    return HistoryQuery(name(query, "device"), name(query, "quantity"), number, start, end, parts)


def name(query: Mapping[str, str], key: str) -> str:
    """A name; empty when it is not there.

    Raises:
        ValueError: no device is called so.
    """
    text = query.get(key, "")
    if "\0" in text:
        raise ValueError(f"{key} has a NUL")
    text.encode()
    return text


def moment(query: Mapping[str, str], key: str, default: float) -> float:
    """s since 1970.

    Raises:
        ValueError: it is no time.
    """
    if key not in query:
        return default
    at = finite(query[key])
    if not 0 <= at < LATEST:
        raise ValueError(f"{key} is no time")
    return at
