"""A history for the page's plot: its parts, its gaps, and late readings. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

from mavproxy_gradys.station.store import HistoryBucket

GAP = 3.5  # times the usual interval between readings
SHORTEST_GAP = 2.0  # s
LATE = 10.0  # s from measurement to storage


def spacing(buckets: Sequence[HistoryBucket], width: float) -> float:
    """The usual interval between readings (s); the width of a part if each part has one reading.

    Args:
        buckets: the parts with readings.
        width: s of one part.
    """
    within = [(bucket.last - bucket.first) / (bucket.readings - 1) for bucket in buckets if bucket.readings > 1]
    if 2 * len(within) >= len(buckets):
        return max(median(within), 0.0) if within else width
    between = [after.first - before.last for before, after in zip(buckets, buckets[1:], strict=False)]
    return median(between) if between else width


def gaps(buckets: Sequence[HistoryBucket], width: float) -> list[tuple[float, float]]:
    """The start and end of each gap (s since 1970)."""
    shortest = max(GAP * spacing(buckets, width), SHORTEST_GAP)
    return [
        (before.last, after.first)
        for before, after in zip(buckets, buckets[1:], strict=False)
        if after.first - before.last > shortest
    ]


def history_view(buckets: Sequence[HistoryBucket], width: float) -> dict[str, Any]:
    """The JSON object for the page."""
    return {
        "parts": [list(bucket) for bucket in buckets],
        "gaps": gaps(buckets, width),
        "late": [[bucket.first, bucket.last, bucket.delay] for bucket in buckets if bucket.delay > LATE],
    }
