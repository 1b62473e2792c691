"""The newest readings of each device and quantity, in memory, for who wants to see them over time. Pure."""

from __future__ import annotations

from collections import deque
from typing import Any

from mavproxy_gradys.bounded import Bounded
from mavproxy_gradys.forwarding.readings import Reading

MOST_POINTS = 600  # of a series
MOST_SERIES = 100  # of a further one the series that was silent longest is forgotten


class RecentReadings:
    """Keeps numbers; other values, such as texts and places, make no curve."""

    def __init__(self) -> None:
        self._series: Bounded[tuple[str, str], tuple[str, deque[tuple[float, float]]]] = Bounded(MOST_SERIES)

    def add(self, reading: Reading) -> None:
        """Note a reading."""
        value = reading.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            return
        key = reading.device, reading.quantity
        _, points = self._series.get(key) or ("", deque(maxlen=MOST_POINTS))
        points.append((reading.time, float(value)))
        self._series[key] = reading.representation, points

    def report(self, since: float) -> list[dict[str, Any]]:
        """Each series by device and quantity; its points [s since 1970, value] are those after `since`."""
        return [
            {
                "device": device,
                "quantity": quantity,
                "representation": representation,
                "points": [[round(at, 3), value] for at, value in points if at > since],
            }
            for (device, quantity), (representation, points) in sorted(self._series.items())
        ]
